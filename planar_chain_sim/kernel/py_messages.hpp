// What a tick of the node reads and writes besides the state, so often that Python would take too long over it: commands
// that come, events that tell of them.
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

#include "py_model.hpp"

// Finite numbers as a JSON list, each with the fewest digits that give it back: what `str(values.tolist())` says.
inline std::string json_list(const Array& values) {
#ifdef __cpp_lib_to_chars
  std::string text = "[";
  char digits[32];
  for (py::ssize_t k = 0; k < values.size(); ++k) {
    const std::string_view number(digits, std::to_chars(digits, digits + sizeof digits, values.data()[k]).ptr - digits);
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
inline py::object plain_command(const py::bytes& data, Array& effort, long long tick, const char* topic) {
  const std::string_view message = data;
  const auto joints = static_cast<std::uint32_t>(effort.size());
  const std::uint32_t head[] = {256, 0, 0, joints};   // encapsulation, no dimensions, data_offset, count; then a gap
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
