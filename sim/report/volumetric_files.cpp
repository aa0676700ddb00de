#include "sim/report/volumetric_files.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/files/output.h"
#include "sim/report/json_numbers.h"
#include "sim/report/pose_files.h"

#if ABBE_RENDER
#include "render/label.h"
#include "render/plot.h"
#include "render/point_data.h"
#include "render/structured_grid.h"
#include "render/volume_map.h"
#endif

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using nlohmann::ordered_json;

Vector3d row(const cutting::Points& points, std::size_t i, double unit) {
  return points.row(Eigen::Index(i)).transpose() / unit;
}

ordered_json place(const VolumetricMap& map, std::size_t pose) {
  const PoseList& poses = map.grid.poses;
  ordered_json json{{"pose", pose + 1}};
  for (std::size_t c = 0; c < poses.columns.size(); ++c)
    json[poses.columns[c].head] = poses.numbers[pose * poses.columns.size() + c];
  json["tip_mm"] = numbers(row(map.nominal, pose, 1.0));
  json["deviation_um"] = numbers(row(map.deviation, pose, units::um));
  json["direction_urad"] = numbers(row(map.direction, pose, units::urad));
  return json;
}

bool runs(const PoseGrid& grid, int joint) {
  for (const PoseGrid::Run& run : grid.runs)
    if (run.joint == joint) return true;
  return false;
}

/// "X -300 .. 300 mm (11), Y ..."
std::string grid_text(const IdleMachine& idle, const PoseGrid& grid) {
  std::string text;
  for (const PoseGrid::Run& run : grid.runs) {
    const auto& joint = idle.machine.nominal.joints()[std::size_t(run.joint)];
    text += fmt::format("{}{} {:.6g} .. {:.6g} {} ({})", text.empty() ? "" : ", ", joint.name,
                        run.from, run.to, position_word(joint), run.count);
  }
  return text;
}

/// "A = 0 deg, C = 0 deg"
std::string standing_text(const IdleMachine& idle, const PoseGrid& grid) {
  std::string text;
  for (std::size_t c = 0; c < grid.poses.columns.size(); ++c) {
    if (runs(grid, grid.poses.columns[c].joint)) continue;
    const auto& joint = idle.machine.nominal.joints()[std::size_t(grid.poses.columns[c].joint)];
    text += fmt::format("{}{} = {:.6g} {}", text.empty() ? "" : ", ", joint.name,
                        grid.poses.numbers[c], position_word(joint));
  }
  return text;
}

#if ABBE_RENDER

/// What a picture shows.
struct Shown {
  const VolumetricMap& map;
  const VolumetricSummary& summary;
  const std::vector<std::string>& warnings;
};

std::string name_of(const IdleMachine& idle) {
  const std::string& name = idle.scene.machine.name;
  return name.empty() ? idle.scene.file.stem().string() : name;
}

/// With a true minus sign, as pictures have it.
std::string typeset(std::string text) {
  for (std::size_t at = 0; (at = text.find('-', at)) != std::string::npos;)
    text.replace(at, 1, "\u2212");
  return text;
}

std::string three(const Vector3d& v) {
  return fmt::format("{}, {}, {}", render::figure(v.x()), render::figure(v.y()),
                     render::figure(v.z()));
}

std::string figures_line(const Shown& shown) {
  const PoseStatistics& s = shown.summary.all;
  const Vector3d at = row(shown.map.nominal, s.worst, 1.0);
  return typeset(fmt::format("max {} µm at ({:.4g}, {:.4g}, {:.4g}) mm, 95 % below {}, RMS {}",
                             render::figure(s.max_um), at.x() + 0.0, at.y() + 0.0, at.z() + 0.0,
                             render::figure(s.p95_um), render::figure(s.rms_um)));
}

std::vector<std::string> caption(const IdleMachine& idle, const Shown& shown) {
  std::string where = grid_text(idle, shown.map.grid);
  if (const std::string standing = standing_text(idle, shown.map.grid); !standing.empty())
    where += "; " + standing;
  const VolumetricSummary& s = shown.summary;
  std::vector<std::string> lines{
      "tip, actual minus nominal, in the workpiece frame; + along +X, +Y, +Z; no datum is set",
      typeset(where),
      fmt::format("range in X, Y, Z {} µm; about them {} µrad; two points differ by at most {} µm",
                  three(s.range_um), three(s.range_urad), render::figure(s.worst_pair_um))};
  for (const std::string& warning : shown.warnings) lines.push_back("warning: " + warning);
  return lines;
}

void write_curves_of_one_run(const std::filesystem::path& file, const IdleMachine& idle,
                             const Shown& shown) {
  const VolumetricMap& map = shown.map;
  const PoseGrid::Run& run = map.grid.runs.front();
  const auto& joint = idle.machine.nominal.joints()[std::size_t(run.joint)];
  render::Panel of_tip, of_axis;
  of_tip.title = "tip";
  of_tip.y_label = "deviation / µm";
  of_axis.title = "tool axis";
  of_axis.y_label = "direction / µrad";
  for (int i = 0; i < 3; ++i) {
    render::Series line;
    line.name = std::string("in ") + "XYZ"[i];
    line.x = Eigen::VectorXd::LinSpaced(run.count, run.from, run.to);
    line.y = map.deviation.col(i) / units::um;
    of_tip.series.push_back(line);
    line.y = map.direction.col(i) / units::urad;
    of_axis.series.push_back(line);
  }
  for (render::Panel* panel : {&of_tip, &of_axis})
    panel->x_label = fmt::format("{} / {}", joint.name, position_word(joint));
  render::CurvesOptions options;
  options.title = fmt::format("deviations along {} of {}", joint.name, name_of(idle));
  options.panel_height = 480;
  options.caption = caption(idle, shown);
  options.caption.insert(options.caption.begin(), figures_line(shown));
  render::write_curves(file, {of_tip, of_axis}, options);
}

void write_picture(const std::filesystem::path& file, const IdleMachine& idle, const Shown& shown) {
  if (shown.map.grid.runs.size() < 2) return write_curves_of_one_run(file, idle, shown);
  render::VolumePicture picture;
  picture.title = "volumetric error of " + name_of(idle);
  picture.figures = figures_line(shown);
  picture.points = shown.map.nominal;
  picture.displacement_um = shown.map.deviation / units::um;
  picture.size = shown.map.grid.size;
  picture.caption = caption(idle, shown);
  render::write_volume_map(file, picture);
}

void write_grid(const std::filesystem::path& file, const VolumetricMap& map) {
  std::vector<render::GridArray> arrays{
      {"deviation_um", map.deviation / units::um},
      {"deviation_norm_um", map.deviation.rowwise().norm() / units::um},
      {"direction_urad", map.direction / units::urad},
      {"rotation_urad", map.rotation / units::urad}};
  const PoseList& poses = map.grid.poses;
  const auto width = Eigen::Index(poses.columns.size());
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Rows> all(poses.numbers.data(), map.nominal.rows(), width);
  for (Eigen::Index c = 0; c < width; ++c)
    arrays.push_back({poses.columns[std::size_t(c)].head, all.col(c)});
  render::write_structured_grid(file, map.nominal, map.grid.size, arrays);
}

/// The faces of a grid as triangles, outward; of a grid of one layer both sides are one face.
cutting::Triangles faces_of(const std::array<int, 3>& size) {
  const std::array<int, 3> stride{1, size[0], size[0] * size[1]};
  std::vector<std::array<int, 3>> all;
  for (std::size_t d = 0; d < 3; ++d) {
    const std::size_t a = (d + 1) % 3, b = (d + 2) % 3;
    for (int end = 0; end < std::min(2, size[d]); ++end) {
      const int base = end == 0 ? 0 : (size[d] - 1) * stride[d];
      const int i_step = end == 0 ? stride[b] : stride[a], i_size = end == 0 ? size[b] : size[a];
      const int j_step = end == 0 ? stride[a] : stride[b], j_size = end == 0 ? size[a] : size[b];
      for (int i = 0; i + 1 < i_size; ++i)
        for (int j = 0; j + 1 < j_size; ++j) {
          const int p = base + i * i_step + j * j_step;
          all.push_back({p, p + i_step, p + i_step + j_step});
          all.push_back({p, p + i_step + j_step, p + j_step});
        }
    }
  }
  cutting::Triangles faces(Eigen::Index(all.size()), 3);
  for (std::size_t i = 0; i < all.size(); ++i)
    faces.row(Eigen::Index(i)) << all[i][0], all[i][1], all[i][2];
  return faces;
}

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
  faces.triangles = faces_of(map.grid.size);
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
                    {"unit", position_word(joint)},
                    {"from", run.from},
                    {"to", run.to},
                    {"count", run.count}});
  }
  for (std::size_t c = 0; c < map.grid.poses.columns.size(); ++c)
    if (const auto& column = map.grid.poses.columns[c]; !runs(map.grid, column.joint))
      standing[column.head] = map.grid.poses.numbers[c];
  const auto [a, b] = s.worst_pair;
  return {{"machine", idle.scene.machine.name},
          {"convention", pose_convention},
          {"grid", grid},
          {"standing", standing},
          {"poses", s.all.poses},
          {"deviation_um",
           {{"max", s.all.max_um},
            {"p95", s.all.p95_um},
            {"rms", s.all.rms_um},
            {"mean", numbers(s.mean_um)}}},
          {"worst", place(map, s.all.worst)},
          {"direction_urad",
           {{"max", s.all.direction_max_urad}, {"worst", place(map, s.all.direction_worst)}}},
          {"volumetric_error",
           {{"by", "ISO 230-1: range of the deviations in X, Y, Z and of the rotations about them"},
            {"range_um", numbers(s.range_um)},
            {"range_urad", numbers(s.range_urad)}}},
          {"worst_pair",
           {{"difference_um", s.worst_pair_um}, {"a", place(map, a)}, {"b", place(map, b)}}}};
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
    write_picture(file, table.idle(), {map, s, warnings});
  });
#endif
}

}  // namespace abbe::sim
