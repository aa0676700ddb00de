#include "sim/study/words.h"

#include <vector>

namespace abbe::sim::study {

std::string title_of(Response response) {
  switch (response) {
    case Response::Pv:
      return "PV";
    case Response::Rms:
      return "RMS";
    case Response::Mean:
      return "mean";
    case Response::Std:
      return "standard deviation";
    case Response::MaxAbs:
      return "largest deviation";
    case Response::P95Abs:
      return "P95 of the deviation's size";
    case Response::InTolerance:
      return "area in tolerance";
    case Response::FormPv:
      return "PV of form";
    case Response::FormRms:
      return "RMS of form";
    case Response::TextureSa:
      return "Sa of texture";
    case Response::TextureSq:
      return "Sq of texture";
    case Response::TextureSz:
      return "Sz of texture";
  }
  return "";
}

std::string shown_unit(const std::string& unit) {
  if (unit == "um") return "µm";
  if (unit == "urad") return "µrad";
  if (unit == "deg") return "°";
  return unit;
}

std::string shown_unit(Response response) { return shown_unit(std::string(unit_of(response))); }

std::string unit_of(const Input& input) { return input.unit.empty() ? "1" : input.unit; }

std::string one_line(const std::string& text) {
  std::string line;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte != 0x7f)
      line += c;
    else if (!line.empty() && line.back() != ' ')
      line += ' ';
  }
  return line;
}

std::string short_line(const std::string& text, std::size_t most) {
  const std::string line = one_line(text);
  std::vector<std::size_t> starts;  // of characters
  for (std::size_t i = 0; i < line.size(); ++i)
    if ((static_cast<unsigned char>(line[i]) & 0xC0u) != 0x80u) starts.push_back(i);
  if (starts.size() <= most || most < 3) return line;
  const std::size_t front = most / 2, back = most - 1 - front;
  return line.substr(0, starts[front]) + "…" + line.substr(starts[starts.size() - back]);
}

}  // namespace abbe::sim::study
