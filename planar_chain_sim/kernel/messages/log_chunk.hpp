// The chunks of a log file, written fast enough for every tick of the node.
#pragma once

#include <pybind11/pybind11.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

namespace py = pybind11;

// The current chunk of an MCAP log (mcap.dev/spec): its records, and for each channel the places of its messages. One
// thread appends, which makes no Python object and takes 0.1 us; the writing thread takes the whole chunk at once.
class LogChunk {
 public:
  // A record made elsewhere: a schema or a channel.
  void add_record(const std::string_view& record) { records_.insert(records_.end(), record.begin(), record.end()); }

  // A message, given as a bytes-like object; returns size(). A log time before the last message's is taken for that
  // one's.
  std::size_t add_message(std::uint16_t channel, std::uint64_t log_time, const py::object& data,
                          std::uint64_t publish_time, std::uint32_t sequence) {
    Py_buffer view;
    if (PyObject_GetBuffer(data.ptr(), &view, PyBUF_SIMPLE)) throw py::error_already_set();
    const std::unique_ptr<Py_buffer, decltype(&PyBuffer_Release)> release(&view, &PyBuffer_Release);
    const auto* bytes = static_cast<const char*>(view.buf);
    if (places_.size() <= channel) places_.resize(channel + std::size_t(1));
    last_time_ = std::max(log_time, last_time_);
    if (!messages) first_time_ = last_time_;

    Numbers<16> place;
    place.put(last_time_), place.put(std::uint64_t(size()));
    Numbers<31> head;
    head.put(message_opcode), head.put(std::uint64_t(22 + view.len)), head.put(channel), head.put(sequence);
    head.put(last_time_), head.put(publish_time);
    records_.insert(records_.end(), head.bytes, head.bytes + sizeof head.bytes);
    records_.insert(records_.end(), bytes, bytes + view.len);
    places_[channel].insert(places_[channel].end(), place.bytes, place.bytes + sizeof place.bytes);
    ++messages;
    return size();
  }

  // Begins the next chunk and returns the records of this one, its first and last log time and {channel: index}, an
  // index being the log time and place of each message.
  py::tuple take() {
    py::dict indexes;
    for (std::size_t channel = 0; channel < places_.size(); ++channel)
      if (!places_[channel].empty()) indexes[py::int_(channel)] = bytes_of(places_[channel]);
    const py::tuple taken = py::make_tuple(bytes_of(records_), first_time_, last_time_, indexes);
    records_.clear();  // keeps the memory: chunks are about as long as each other
    for (Bytes& places : places_) places.clear();
    messages = 0;
    return taken;
  }

  std::size_t size() const { return records_.size(); }
  std::size_t messages = 0;

 private:
  using Bytes = std::vector<char>;
  static constexpr std::uint8_t message_opcode = 5;

  // Numbers one after another, little-endian on every machine.
  template <std::size_t count>
  struct Numbers {
    char bytes[count];
    std::size_t end = 0;
    template <typename Number>
    void put(Number number) {
      for (std::size_t k = 0; k < sizeof number; ++k) bytes[end++] = static_cast<char>(number >> (8 * k));
    }
  };
  static py::bytes bytes_of(const Bytes& bytes) { return {bytes.data(), bytes.size()}; }

  Bytes records_;
  std::vector<Bytes> places_;  // by channel
  std::uint64_t first_time_ = 0, last_time_ = 0;
};
