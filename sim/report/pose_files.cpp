#include "sim/report/pose_files.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/files/output.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

constexpr std::string_view json_begins = "{\n  \"abbe_poses\": 1,";

/// `"key": value,` lines of an object within an object.
std::string members(const ordered_json& object) {
  const std::string text = json_text(object);
  return text.substr(2, text.size() - 5);  // without the braces and their line ends
}

PoseStatistics write_all(std::FILE* stream, const std::string& name, const PoseTable& table,
                         const PoseList& poses, TableFormat format,
                         const std::vector<std::string>& warnings, ProgressLine* progress) {
  const auto sink = [&](std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), stream) != text.size())
      throw OutputFailure(name + ": cannot be written: " + std::strerror(errno));
  };
  if (format == TableFormat::Csv) return write_poses(table, poses, format, sink, progress);
  const IdleMachine& idle = table.idle();
  sink(std::string(json_begins) + "\n" +
       members({{"scene", idle.scene.file.string()},
                {"machine", idle.scene.machine.name},
                {"convention", pose_convention}}) +
       ",\n  \"poses\": [\n");
  const PoseStatistics statistics = write_poses(table, poses, format, sink, progress);
  sink("\n  ],\n" + members({{"summary", to_json(statistics, poses)}, {"warnings", warnings}}) +
       "\n}\n");
  return statistics;
}

struct Close {
  void operator()(std::FILE* stream) const { std::fclose(stream); }
};

}  // namespace

PoseStatistics write_pose_file(const ResultFile& file, const PoseTable& table,
                               const PoseList& poses, TableFormat format,
                               const std::vector<std::string>& warnings, ProgressLine* progress) {
  const std::string name = file.path().string();
  PoseStatistics statistics;
  std::exception_ptr refused;  // not a fault of the file
  const auto write = [&](const std::filesystem::path& temporary) {
    const auto fail = [&] {
      throw OutputFailure(name + ": cannot be written: " + std::strerror(errno));
    };
    std::unique_ptr<std::FILE, Close> stream(std::fopen(temporary.c_str(), "wb"));
    if (!stream) fail();
    try {
      statistics = write_all(stream.get(), name, table, poses, format, warnings, progress);
    } catch (const OutputFailure&) {
      throw;
    } catch (...) {
      refused = std::current_exception();
      throw OutputFailure("refused");
    }
    if (std::fclose(stream.release()) != 0) fail();
  };
  try {
    write_file(file, write);
  } catch (const OutputFailure&) {
    if (refused) std::rethrow_exception(refused);
    throw;
  }
  return statistics;
}

PoseStatistics print_poses(const PoseTable& table, const PoseList& poses, TableFormat format,
                           const std::vector<std::string>& warnings, ProgressLine* progress) {
  const PoseStatistics statistics =
      write_all(stdout, "standard output", table, poses, format, warnings, progress);
  if (std::fflush(stdout) != 0)
    throw OutputFailure(std::string("standard output: cannot be written: ") + std::strerror(errno));
  return statistics;
}

ordered_json to_json(const PoseStatistics& s, const PoseList& poses) {
  const auto place = [&](std::size_t pose) {
    ordered_json json{{"pose", pose + 1}};
    const std::size_t width = poses.columns.size();
    for (std::size_t c = 0; c < width; ++c)
      json[poses.columns[c].head] = poses.numbers[pose * width + c];
    return json;
  };
  return {{"poses", s.poses},
          {"deviation_um", {{"max", s.max_um}, {"p95", s.p95_um}, {"rms", s.rms_um}}},
          {"worst", place(s.worst)},
          {"direction_urad", {{"max", s.direction_max_urad}, {"worst", place(s.direction_worst)}}}};
}

std::string to_text(const PoseStatistics& s, const PoseList& poses) {
  return fmt::format(
      "{} poses, {}\n"
      "tip, um           max {:.4f}, 95 % below {:.4f}, RMS {:.4f}\n"
      "  worst at        {} (pose {})\n"
      "tool axis, urad   max {:.4f}\n"
      "  worst at        {} (pose {})\n",
      s.poses, pose_convention, s.max_um, s.p95_um, s.rms_um, poses.text(s.worst), s.worst + 1,
      s.direction_max_urad, poses.text(s.direction_worst), s.direction_worst + 1);
}

TableFormat pose_file_format(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".csv") return TableFormat::Csv;
  if (ending == ".json") return TableFormat::Json;
  throw OutputFailure("expected a file named .csv or .json to write to, seen " + file.string());
}

}  // namespace abbe::sim
