#include "sim/report/pose_report.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/files/json_files.h"
#include "sim/files/output.h"

#if ABBE_RENDER
#include "render/figures.h"
#include "render/plot.h"
#include "render/volume_map.h"
#include "render/vtk_writer.h"
#endif

namespace abbe::sim {

namespace {

using nlohmann::ordered_json;

/// Returns the rows of a homogeneous matrix.
ordered_json pose_rows(const kinematics::Pose& T) {
  ordered_json rows = ordered_json::array();
  for (int i = 0; i < 4; ++i)
    rows.push_back({T.matrix()(i, 0), T.matrix()(i, 1), T.matrix()(i, 2), T.matrix()(i, 3)});
  return rows;
}

/// Returns the rows of a homogeneous matrix below its name.
std::string rows_text(const char* name, const kinematics::Pose& T) {
  std::string text = fmt::format("{}\n", name);
  for (int i = 0; i < 4; ++i)
    text += fmt::format("  {:16.9f} {:16.9f} {:16.9f} {:16.9f}\n", T.matrix()(i, 0),
                        T.matrix()(i, 1), T.matrix()(i, 2), T.matrix()(i, 3));
  return text;
}

/// Returns T_nominal^-1 T_actual.
kinematics::Pose pose_error(const TipPose& pose) {
  return kinematics::error_transform(pose.nominal, pose.actual);
}

}  // namespace

ordered_json to_json(const PoseResult& result) {
  ordered_json columns = ordered_json::object();
  for (std::size_t i = 0; i < result.column_names.size(); ++i)
    columns[result.column_names[i]] = result.numbers[i];
  return {{"T_wt_nominal", pose_rows(result.pose.nominal)},
          {"T_wt_actual", pose_rows(result.pose.actual)},
          {"deviation_mm", numbers(result.pose.deviation())},
          {"direction_rad", numbers(result.pose.direction())},
          {"E", pose_rows(pose_error(result.pose))},
          {"columns", columns},
          {"warnings", result.warnings}};
}

std::string to_text(const PoseResult& result) {
  const Eigen::Vector3d d = result.pose.deviation() / units::um,
                        u = result.pose.direction() / units::urad;
  std::string text = rows_text("T_wt_nominal", result.pose.nominal) +
                     rows_text("T_wt_actual", result.pose.actual) +
                     rows_text("E", pose_error(result.pose));
  text += fmt::format("deviation of the tip    {:10.4f} {:10.4f} {:10.4f} um, workpiece frame\n",
                      d.x(), d.y(), d.z());
  text +=
      fmt::format("deviation of direction  {:10.4f} {:10.4f} {:10.4f} urad\n", u.x(), u.y(), u.z());
  for (std::size_t k = 0; k < result.requested_columns.size(); ++k) {
    const std::string name = escaped(result.requested_columns[k].name);
    text += fmt::format(
        "{:<22}", result.requested_columns[k].derivative ? "d/d" + name : name + ", um, urad");
    for (std::size_t i = 6 * k; i < 6 * k + 6; ++i)
      text += fmt::format(" {:12.6g}", result.numbers[i]);
    text += "\n";
  }
  return text;
}

namespace {

constexpr std::string_view json_start = "{\n  \"abbe_poses\": 1,";

/// Returns the members of an object as lines of JSON text, for insertion into another object.
std::string member_lines(const ordered_json& object) {
  const std::string text = json_text(object);
  return text.substr(2, text.size() - 5);  // without the braces and their line breaks
}

/// Writes a table row by row, because a grid may have millions of poses. JSON is therefore not
/// written as one object, but as beginning, rows and summary.
PoseStatistics write_table_rows(std::FILE* stream, const std::string& name, const PoseTable& table,
                                const PoseList& poses, TableFormat format,
                                const std::vector<std::string>& warnings, ProgressLine* progress) {
  const auto sink = [&](std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), stream) != text.size())
      throw OutputFailure(name + ": cannot be written: " + std::strerror(errno));
  };
  if (format == TableFormat::Csv) return write_poses(table, poses, format, sink, progress);
  const IdleMachine& idle = table.idle();
  sink(std::string(json_start) + "\n" +
       member_lines({{"scene", idle.scene.file.string()},
                     {"machine", idle.scene.machine.name},
                     {"convention", pose_convention}}) +
       ",\n  \"poses\": [\n");
  const PoseStatistics statistics = write_poses(table, poses, format, sink, progress);
  sink("\n  ],\n" +
       member_lines({{"summary", to_json(statistics, poses)}, {"warnings", warnings}}) + "\n}\n");
  return statistics;
}

struct StreamCloser {
  void operator()(std::FILE* stream) const { std::fclose(stream); }
};

}  // namespace

PoseStatistics write_pose_file(const ResultFile& file, const PoseTable& table,
                               const PoseList& poses, TableFormat format,
                               const std::vector<std::string>& warnings, ProgressLine* progress) {
  const std::string name = file.path().string();
  PoseStatistics statistics;
  std::exception_ptr pose_failure;  // an exception that does not concern the file
  const auto write = [&](const std::filesystem::path& temporary) {
    const auto fail = [&] {
      throw OutputFailure(name + ": cannot be written: " + std::strerror(errno));
    };
    std::unique_ptr<std::FILE, StreamCloser> stream(std::fopen(temporary.c_str(), "wb"));
    if (!stream) fail();
    try {
      statistics = write_table_rows(stream.get(), name, table, poses, format, warnings, progress);
    } catch (const OutputFailure&) {
      throw;
    } catch (...) {
      // write_file removes the temporary file after an OutputFailure; the original exception is
      // thrown below.
      pose_failure = std::current_exception();
      throw OutputFailure("refused");
    }
    if (std::fclose(stream.release()) != 0) fail();
  };
  try {
    write_file(file, write);
  } catch (const OutputFailure&) {
    if (pose_failure) std::rethrow_exception(pose_failure);
    throw;
  }
  return statistics;
}

PoseStatistics print_poses(const PoseTable& table, const PoseList& poses, TableFormat format,
                           const std::vector<std::string>& warnings, ProgressLine* progress) {
  const PoseStatistics statistics =
      write_table_rows(stdout, "standard output", table, poses, format, warnings, progress);
  if (std::fflush(stdout) != 0)
    throw OutputFailure(std::string("standard output: cannot be written: ") + std::strerror(errno));
  return statistics;
}

ordered_json to_json(const PoseStatistics& s, const PoseList& poses) {
  const auto pose_json = [&](std::size_t pose) {
    ordered_json json{{"pose", pose + 1}};
    const std::size_t width = poses.columns.size();
    for (std::size_t c = 0; c < width; ++c)
      json[poses.columns[c].head] = poses.numbers[pose * width + c];
    return json;
  };
  return {
      {"poses", s.poses},
      {"deviation_um", {{"max", s.max_um}, {"p95", s.p95_um}, {"rms", s.rms_um}}},
      {"worst", pose_json(s.worst)},
      {"direction_urad", {{"max", s.direction_max_urad}, {"worst", pose_json(s.direction_worst)}}}};
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
  throw OutputFailure("expected a file name that ends in .csv or .json, seen " + file.string());
}

namespace {

using Eigen::Vector3d;

/// Returns a row of a table of points or vectors, in a unit.
Vector3d row(const cutting::Points& points, std::size_t i, double unit) {
  return points.row(Eigen::Index(i)).transpose() / unit;
}

/// Returns a pose of the grid with its axis positions and errors.
ordered_json grid_pose_json(const VolumetricMap& map, std::size_t pose) {
  const PoseList& poses = map.grid.poses;
  ordered_json json{{"pose", pose + 1}};
  for (std::size_t c = 0; c < poses.columns.size(); ++c)
    json[poses.columns[c].head] = poses.numbers[pose * poses.columns.size() + c];
  json["tip_mm"] = numbers(row(map.nominal, pose, 1.0));
  json["deviation_um"] = numbers(row(map.deviation, pose, units::um));
  json["direction_urad"] = numbers(row(map.direction, pose, units::urad));
  return json;
}

/// Returns true if the grid varies an axis.
bool is_varied(const PoseGrid& grid, int joint) {
  for (const PoseGrid::Run& run : grid.runs)
    if (run.joint == joint) return true;
  return false;
}

/// Returns "X -300 .. 300 mm (11), Y ...".
std::string grid_text(const IdleMachine& idle, const PoseGrid& grid) {
  std::string text;
  for (const PoseGrid::Run& run : grid.runs) {
    const auto& joint = idle.machine.nominal.joints()[std::size_t(run.joint)];
    text += fmt::format("{}{} {:.6g} .. {:.6g} {} ({})", text.empty() ? "" : ", ", joint.name,
                        run.from, run.to, position_unit_label(joint), run.count);
  }
  return text;
}

/// Returns the positions of the axes that the grid does not vary: "A = 0 deg, C = 0 deg".
std::string standing_text(const IdleMachine& idle, const PoseGrid& grid) {
  std::string text;
  for (std::size_t c = 0; c < grid.poses.columns.size(); ++c) {
    if (is_varied(grid, grid.poses.columns[c].joint)) continue;
    const auto& joint = idle.machine.nominal.joints()[std::size_t(grid.poses.columns[c].joint)];
    text += fmt::format("{}{} = {:.6g} {}", text.empty() ? "" : ", ", joint.name,
                        grid.poses.numbers[c], position_unit_label(joint));
  }
  return text;
}

#if ABBE_RENDER

/// Data of a volumetric picture.
struct VolumetricData {
  const VolumetricMap& map;
  const VolumetricSummary& summary;
  const std::vector<std::string>& warnings;
};

/// Returns the name of the machine, or that of the scene if the machine has none.
std::string machine_title(const IdleMachine& idle) {
  const std::string& name = idle.scene.machine.name;
  return name.empty() ? idle.scene.file.stem().string() : name;
}

/// Returns the text with hyphens replaced by minus signs.
std::string with_minus_signs(std::string text) {
  for (std::size_t hyphen = 0; (hyphen = text.find('-', hyphen)) != std::string::npos;)
    text.replace(hyphen, 1, "\u2212");
  return text;
}

std::string xyz_text(const Vector3d& v) {
  return fmt::format("{}, {}, {}", render::figure(v.x()), render::figure(v.y()),
                     render::figure(v.z()));
}

/// Returns the line with the figures of a map, for a picture.
std::string figures_line(const VolumetricData& volumetric) {
  const PoseStatistics& s = volumetric.summary.all;
  const Vector3d tip = row(volumetric.map.nominal, s.worst, 1.0);
  // Adding 0.0 turns -0 into 0.
  return with_minus_signs(
      fmt::format("max {} µm at ({:.4g}, {:.4g}, {:.4g}) mm, 95 % below {}, RMS {}",
                  render::figure(s.max_um), tip.x() + 0.0, tip.y() + 0.0, tip.z() + 0.0,
                  render::figure(s.p95_um), render::figure(s.rms_um)));
}

/// Returns the caption: convention, grid, volumetric error, warnings.
std::vector<std::string> caption(const IdleMachine& idle, const VolumetricData& volumetric) {
  std::string positions = grid_text(idle, volumetric.map.grid);
  if (const std::string standing = standing_text(idle, volumetric.map.grid); !standing.empty())
    positions += "; " + standing;
  const VolumetricSummary& s = volumetric.summary;
  std::vector<std::string> lines{
      "tip, actual minus nominal, in the workpiece frame; + along +X, +Y, +Z; no datum set",
      with_minus_signs(positions),
      fmt::format(
          "range in X, Y, Z {} µm; about X, Y, Z {} µrad; two points differ by at most {} µm",
          xyz_text(s.range_um), xyz_text(s.range_urad), render::figure(s.worst_pair_um))};
  for (const std::string& warning : volumetric.warnings) lines.push_back("warning: " + warning);
  return lines;
}

/// Draws a grid of one axis as curves over its position.
void write_single_run_curves(const std::filesystem::path& file, const IdleMachine& idle,
                             const VolumetricData& volumetric) {
  const VolumetricMap& map = volumetric.map;
  const PoseGrid::Run& run = map.grid.runs.front();
  const auto& joint = idle.machine.nominal.joints()[std::size_t(run.joint)];
  render::Panel tip_panel, axis_panel;
  tip_panel.title = "tip";
  tip_panel.y_label = "deviation / µm";
  axis_panel.title = "tool axis";
  axis_panel.y_label = "direction / µrad";
  for (int i = 0; i < 3; ++i) {
    render::Series line;
    line.name = std::string("in ") + "XYZ"[i];
    line.x = Eigen::VectorXd::LinSpaced(run.count, run.from, run.to);
    line.y = map.deviation.col(i) / units::um;
    tip_panel.series.push_back(line);
    line.y = map.direction.col(i) / units::urad;
    axis_panel.series.push_back(line);
  }
  for (render::Panel* panel : {&tip_panel, &axis_panel})
    panel->x_label = fmt::format("{} / {}", joint.name, position_unit_label(joint));
  render::CurvesOptions options;
  options.title = fmt::format("deviations along {} of {}", joint.name, machine_title(idle));
  options.panel_height = 480;
  options.caption = caption(idle, volumetric);
  options.caption.insert(options.caption.begin(), figures_line(volumetric));
  render::write_curves(file, {tip_panel, axis_panel}, options);
}

/// Draws the grid in space, or as curves if it has a single axis.
void write_volumetric_picture(const std::filesystem::path& file, const IdleMachine& idle,
                              const VolumetricData& volumetric) {
  if (volumetric.map.grid.runs.size() < 2) return write_single_run_curves(file, idle, volumetric);
  render::VolumePicture picture;
  picture.title = "volumetric error of " + machine_title(idle);
  picture.figures = figures_line(volumetric);
  picture.points = volumetric.map.nominal;
  picture.displacement_um = volumetric.map.deviation / units::um;
  picture.size = volumetric.map.grid.size;
  picture.caption = caption(idle, volumetric);
  render::write_volume_map(file, picture);
}

/// Writes the grid with the axis positions, which are the coordinates of an error table.
void write_grid(const std::filesystem::path& file, const VolumetricMap& map) {
  std::vector<render::GridArray> arrays{
      {"deviation_um", map.deviation / units::um},
      {"deviation_norm_um", map.deviation.rowwise().norm() / units::um},
      {"direction_urad", map.direction / units::urad},
      {"rotation_urad", map.rotation / units::urad}};
  const PoseList& poses = map.grid.poses;
  const auto width = Eigen::Index(poses.columns.size());
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Rows> positions(poses.numbers.data(), map.nominal.rows(), width);
  for (Eigen::Index c = 0; c < width; ++c)
    arrays.push_back({poses.columns[std::size_t(c)].head, positions.col(c)});
  render::write_structured_grid(file, map.nominal, map.grid.size, arrays);
}

/// Returns the outer faces of a grid as triangles with outward orientation. A grid of a single
/// layer has one face for both sides.
cutting::Triangles outer_faces(const std::array<int, 3>& size) {
  const std::array<int, 3> stride{1, size[0], size[0] * size[1]};
  std::vector<std::array<int, 3>> corners;
  for (std::size_t d = 0; d < 3; ++d) {
    const std::size_t a = (d + 1) % 3, b = (d + 2) % 3;
    for (int end = 0; end < std::min(2, size[d]); ++end) {
      const int base = end == 0 ? 0 : (size[d] - 1) * stride[d];
      // The directions are exchanged at one end, so that both faces point outwards.
      const int i_step = end == 0 ? stride[b] : stride[a], i_size = end == 0 ? size[b] : size[a];
      const int j_step = end == 0 ? stride[a] : stride[b], j_size = end == 0 ? size[a] : size[b];
      for (int i = 0; i + 1 < i_size; ++i)
        for (int j = 0; j + 1 < j_size; ++j) {
          const int p = base + i * i_step + j * j_step;
          corners.push_back({p, p + i_step, p + i_step + j_step});
          corners.push_back({p, p + i_step + j_step, p + j_step});
        }
    }
  }
  cutting::Triangles faces(Eigen::Index(corners.size()), 3);
  for (std::size_t i = 0; i < corners.size(); ++i)
    faces.row(Eigen::Index(i)) << corners[i][0], corners[i][1], corners[i][2];
  return faces;
}

/// Writes the outer faces of the grid for ParaView.
void write_faces(const std::filesystem::path& file, const VolumetricMap& map) {
  std::vector<std::string> names{"deviation_um", "direction_urad"};
  std::vector<Eigen::VectorXd> values{map.deviation.rowwise().norm() / units::um,
                                      map.direction.rowwise().norm() / units::urad};
  for (int i = 0; i < 3; ++i) {
    names.push_back(fmt::format("deviation_{}_um", "xyz"[i]));
    values.push_back(map.deviation.col(i) / units::um);
  }
  cutting::Design faces;
  faces.vertices = map.nominal;
  faces.triangles = outer_faces(map.grid.size);
  render::write_point_data(file, faces, names, values);
}

#endif

}  // namespace

ordered_json to_json(const IdleMachine& idle, const VolumetricMap& map,
                     const VolumetricSummary& s) {
  ordered_json grid = ordered_json::array(), standing = ordered_json::object();
  for (const PoseGrid::Run& run : map.grid.runs) {
    const auto& joint = idle.machine.nominal.joints()[std::size_t(run.joint)];
    grid.push_back({{"axis", std::string(1, joint.name)},
                    {"unit", position_unit_label(joint)},
                    {"from", run.from},
                    {"to", run.to},
                    {"count", run.count}});
  }
  for (std::size_t c = 0; c < map.grid.poses.columns.size(); ++c)
    if (const auto& column = map.grid.poses.columns[c]; !is_varied(map.grid, column.joint))
      standing[column.head] = map.grid.poses.numbers[c];
  const auto [a, b] = s.worst_pair;
  return {
      {"machine", idle.scene.machine.name},
      {"convention", pose_convention},
      {"grid", grid},
      {"standing", standing},
      {"poses", s.all.poses},
      {"deviation_um",
       {{"max", s.all.max_um},
        {"p95", s.all.p95_um},
        {"rms", s.all.rms_um},
        {"mean", numbers(s.mean_um)}}},
      {"worst", grid_pose_json(map, s.all.worst)},
      {"direction_urad",
       {{"max", s.all.direction_max_urad}, {"worst", grid_pose_json(map, s.all.direction_worst)}}},
      {"volumetric_error",
       {{"by", "ISO 230-1: range of the deviations in X, Y, Z and of the rotations about them"},
        {"range_um", numbers(s.range_um)},
        {"range_urad", numbers(s.range_urad)}}},
      {"worst_pair",
       {{"difference_um", s.worst_pair_um},
        {"a", grid_pose_json(map, a)},
        {"b", grid_pose_json(map, b)}}}};
}

std::string to_text(const IdleMachine& idle, const VolumetricMap& map, const VolumetricSummary& s) {
  std::string text;
  const auto line = [&](const char* what, const std::string& value) {
    text += fmt::format("{:<22}{}\n", what, value);
  };
  const PoseList& poses = map.grid.poses;
  line("machine", escaped(idle.scene.machine.name));
  line("grid", fmt::format("{}: {} poses", grid_text(idle, map.grid), s.all.poses));
  if (const std::string standing = standing_text(idle, map.grid); !standing.empty())
    line("standing", standing);
  line("tip, um",
       fmt::format("max {:.4f}, 95 % below {:.4f}, RMS {:.4f}; mean {:.4f} {:.4f} {:.4f}",
                   s.all.max_um, s.all.p95_um, s.all.rms_um, s.mean_um.x(), s.mean_um.y(),
                   s.mean_um.z()));
  line("  worst at", poses.text(s.all.worst));
  line("tool axis, urad", fmt::format("max {:.4f}", s.all.direction_max_urad));
  line("  worst at", poses.text(s.all.direction_worst));
  line("volumetric error", fmt::format("range in X Y Z {:.4f} {:.4f} {:.4f} um, about X Y Z {:.4f} "
                                       "{:.4f} {:.4f} urad (ISO 230-1)",
                                       s.range_um.x(), s.range_um.y(), s.range_um.z(),
                                       s.range_urad.x(), s.range_urad.y(), s.range_urad.z()));
  line("worst pair", fmt::format("differs by {:.4f} um", s.worst_pair_um));
  for (const std::size_t pose : s.worst_pair) line("", poses.text(pose));
  return text + std::string(pose_convention) + "\n";
}

void write_volumetric_files(const ResultFolder& folder, const PoseTable& table,
                            const VolumetricMap& map, [[maybe_unused]] const VolumetricSummary& s,
                            const std::vector<std::string>& warnings) {
  write_pose_file(folder / "volumetric.csv", table, map.grid.poses, TableFormat::Csv, warnings);
#if ABBE_RENDER
  write_file(folder / "volumetric.vts", [&](const auto& file) { write_grid(file, map); });
  write_file(folder / "volumetric.vtp", [&](const auto& file) { write_faces(file, map); });
  write_file(folder / "volumetric.png", [&](const auto& file) {
    write_volumetric_picture(file, table.idle(), {map, s, warnings});
  });
#endif
}

}  // namespace abbe::sim
