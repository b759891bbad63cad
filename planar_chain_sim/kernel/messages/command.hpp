// The command that a node gets at nearly every tick, for which Python would be too slow, and its event.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "../python/arrays.hpp"

// Finite numbers as a JSON list, each with the fewest digits that give it back, as in `str(values.tolist())`.
inline std::string json_list(const Array& values) {
#ifdef __cpp_lib_to_chars
  std::string text = "[";
  char digits[32];
  const auto* const bytes = reinterpret_cast<const char*>(values.data());  // perhaps at an odd address
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

// Reads a std_msgs/msg/Float64MultiArray (CDR) without dimensions. If it has a finite effort for each joint, puts them
// into `effort` and returns the event of the command, a std_msgs/msg/String. Returns None for any other message, which
// Python then checks. Python would take ten times as long for this command.
inline py::object plain_command(const py::bytes& data, Array& effort, long long tick, const std::string& topic) {
  const std::string_view message = data;
  const auto joints = static_cast<std::uint32_t>(effort.size());
  const std::uint32_t head[] = {256, 0, 0, joints};  // encapsulation, no dimensions, data_offset, count; then a gap
  if (effort.ndim() != 1 || !aligned(effort) || !effort.writeable())
    throw py::value_error("the kernel got a bad effort");
  if (!joints || message.size() < 20 + 8 * std::size_t(joints) || std::memcmp(message.data(), head, sizeof head))
    return py::none();
  std::vector<double> values(joints);
  std::memcpy(values.data(), message.data() + 20, 8 * std::size_t(joints));
  if (!std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); })) return py::none();
  std::copy(values.begin(), values.end(), effort.mutable_data());
  std::string told(8, '\0');
  told += "{\"tick\": " + std::to_string(tick) + ", \"kind\": \"command\", \"data\": {\"topic\": \"" + topic +
          "\", \"effort\": " + json_list(effort) + "}}";
  told += '\0';
  const std::uint32_t start[] = {256, static_cast<std::uint32_t>(told.size() - 8)};
  std::memcpy(&told[0], start, sizeof start);
  return py::bytes(told);
}
