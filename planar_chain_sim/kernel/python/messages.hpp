// What a tick of the node reads and writes besides the state, so often that Python would take too long over it: commands
// that come, events that tell of them, records of the log.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "model.hpp"

// Finite numbers as a JSON list, each with the fewest digits that give it back: what `str(values.tolist())` says.
inline std::string json_list(const Array& values) {
#ifdef __cpp_lib_to_chars
  std::string text = "[";
  char digits[32];
  const auto* const bytes = reinterpret_cast<const char*>(values.data());   // perhaps at an odd address
  for (py::ssize_t k = 0; k < values.size(); ++k) {
    double value;
    std::memcpy(&value, bytes + k * sizeof value, sizeof value);
    const std::string_view number(digits, std::to_chars(digits, digits + sizeof digits, value).ptr - digits);
    text.append(k ? ", " : "").append(number);
    if (number.find_first_of(".e") == number.npos) text += ".0";
  }
  return text + "]";
#else
  return py::str(values.attr("tolist")());
#endif
}

// The command that comes at nearly every tick, a std_msgs/msg/Float64MultiArray (CDR) without dimensions: where it has a
// finite effort for each joint, they are put into `effort`, and the event that tells so is returned, a
// std_msgs/msg/String. None for any other message, which is Python's to judge; it would take ten times as long for this.
inline py::object plain_command(const py::bytes& data, Array& effort, long long tick, const std::string& topic) {
  const std::string_view message = data;
  const auto joints = static_cast<std::uint32_t>(effort.size());
  const std::uint32_t head[] = {256, 0, 0, joints};   // encapsulation, no dimensions, data_offset, count; then a gap
  if (effort.ndim() != 1 || !aligned(effort) || !effort.writeable()) throw py::value_error("the kernel got a bad effort");
  if (!joints || message.size() < 20 + 8 * std::size_t(joints) || std::memcmp(message.data(), head, sizeof head))
    return py::none();
  std::vector<double> values(joints);
  std::memcpy(values.data(), message.data() + 20, 8 * std::size_t(joints));
  if (!std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); }))
    return py::none();
  std::copy(values.begin(), values.end(), effort.mutable_data());
  std::string told(8, '\0');
  told += "{\"tick\": " + std::to_string(tick) + ", \"kind\": \"command\", \"data\": {\"topic\": \"" + topic
          + "\", \"effort\": " + json_list(effort) + "}}";
  told += '\0';
  const std::uint32_t start[] = {256, static_cast<std::uint32_t>(told.size() - 8)};
  std::memcpy(&told[0], start, sizeof start);
  return py::bytes(told);
}

// The chunk in the making of an MCAP log (mcap.dev/spec): records, and by channel where each message lies. One thread
// appends, which makes no Python object and takes a tenth of a microsecond; the thread that writes takes all at once.
class LogChunk {
 public:
  // A record made elsewhere: a schema or a channel.
  void add_record(const std::string_view& record) { records_.insert(records_.end(), record.begin(), record.end()); }

  // A message, given as a bytes-like object; returns size(). A log time before the last message's is taken for that one's.
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

  // Begins the next chunk and returns the records of this one, its first and last log time and {channel: index}, an index
  // being the log time and place of each message.
  py::tuple take() {
    py::dict indexes;
    for (std::size_t channel = 0; channel < places_.size(); ++channel)
      if (!places_[channel].empty()) indexes[py::int_(channel)] = bytes_of(places_[channel]);
    const py::tuple taken = py::make_tuple(bytes_of(records_), first_time_, last_time_, indexes);
    records_.clear();   // keeps the memory: chunks are about as long as each other
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
