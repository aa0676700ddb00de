#include "sim/report/program_film.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <variant>

#include <fmt/format.h>

#include "kinematics/bad_input.h"

namespace abbe::sim {

std::optional<FilmInterval> interval_of_lines(const program::Path& path,
                                              const std::optional<LineRange>& lines) {
  std::optional<FilmInterval> stretch;
  for (const program::Block& block : path.blocks) {
    if (lines && (block.file != 0 || block.line < lines->first || block.line > lines->last))
      continue;
    if (!stretch) stretch = FilmInterval{block.start_s, block.end_s};
    stretch->end_s = std::max(stretch->end_s, block.end_s);
  }
  return stretch;
}

FilmPlan film_plan(const FilmInterval& stretch, double seconds, double fps) {
  FilmPlan plan{stretch, {}, fps};
  const auto n = std::max(1L, std::lround(seconds * fps));
  for (long k = 0; k < n; ++k) {
    // The last frame is exactly the end, without rounding.
    const double u = n > 1 ? double(k) / double(n - 1) : 1.0;
    plan.time_s.push_back(k + 1 == n ? stretch.end_s
                                     : stretch.begin_s + u * (stretch.end_s - stretch.begin_s));
  }
  return plan;
}

double speed_factor(const FilmPlan& plan) {
  return (plan.stretch.end_s - plan.stretch.begin_s) * plan.fps / double(plan.time_s.size());
}

std::string speed_text(const FilmPlan& plan) {
  const double times = speed_factor(plan);
  const auto number = [](double x) { return fmt::format("{:.{}f}", x, x < 10.0 ? 1 : 0); };
  if (!(times > 0.0)) return "a moment of the program";
  // Within 5 % of real time no factor is printed.
  if (times >= 1.05) return number(times) + " × faster than real time";
  if (times <= 1.0 / 1.05) return number(1.0 / times) + " × slower than real time";
  return "in real time";
}

namespace {

constexpr std::size_t max_line_bytes = 200;  // bytes

/// Returns lines of text, shortened to what fits into a caption.
std::vector<std::string> text_lines(std::istream& in) {
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) {
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    line.resize(std::min(line.size(), max_line_bytes));
    lines.push_back(std::move(line));
  }
  return lines;
}

/// Returns the lines of a program file; empty if it cannot be read, since the film only quotes
/// them.
std::vector<std::string> read_program_lines(const std::filesystem::path& file) {
  constexpr std::uintmax_t largest = std::uintmax_t(256) << 20;  // more is not worth its memory
  std::error_code failure;
  const std::uintmax_t size = std::filesystem::file_size(file, failure);
  if (failure || size > largest) return {};
  std::ifstream in(file);
  return text_lines(in);
}

}  // namespace

ProgramText::ProgramText(const Job& job, const Commands& commands) {
  const std::string& text =
      commands.rewritten_program.empty() ? job.program_text : commands.rewritten_program;
  if (!text.empty()) {
    std::istringstream in(text);
    files_.push_back(text_lines(in));
  } else if (const auto* file = std::get_if<ProgramDescription::File>(&job.scene.program.source)) {
    files_.push_back(read_program_lines(file->file));
  } else {
    files_.emplace_back();
  }
  for (const std::string& more : path_of(job, commands).more_files)
    files_.push_back(read_program_lines(more));
}

std::string ProgramText::of(const program::Block& block) const {
  if (block.file >= files_.size() || block.line < 1) return {};
  const std::vector<std::string>& lines = files_[block.file];
  const auto row = std::size_t(block.line) - 1;
  return row < lines.size() ? escaped(lines[row]) : std::string();
}

}  // namespace abbe::sim

#if ABBE_RENDER

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "kinematics/pose.h"
#include "kinematics/units.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/tool_poses.h"
#include "sim/report/machine_picture.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Pose;

constexpr render::Colour slide_colour{0.78, 0.82, 0.88}, turn_colour{0.93, 0.84, 0.66},
    bed_colour{0.80, 0.81, 0.83}, clamp_colour{0.66, 0.62, 0.74}, cutter_colour{0.93, 0.72, 0.25},
    shank_colour{0.62, 0.65, 0.69}, holder_colour{0.42, 0.46, 0.52}, raw_colour{0.93, 0.80, 0.55},
    fresh_colour{0.50, 0.66, 0.82}, crash_colour{0.82, 0.16, 0.12}, nominal_path{0.20, 0.35, 0.65},
    actual_path{0.80, 0.25, 0.20};

enum Look : std::uint8_t { raw_style, fresh_style, crash_style };

/// Returns the program that a part of the job runs in this case.
const program::Path& part_path(const FilmSource& cut, std::size_t part) {
  return path_of(parts_of(cut.job)[part], of_part(cut.commands, part));
}

/// Returns the target poses of a part of the job.
const std::vector<Pose>& nominal_poses(const FilmSource& cut, std::size_t part) {
  return target_poses(parts_of(cut.job)[part], of_part(cut.commands, part));
}

/// Returns the pose of the tool with the workpiece spindle turned back.
Pose at_rest(const Job& part, const AxisVector& q, const Pose& T_wt) {
  if (!part.machine.workpiece_spindle) return T_wt;
  const int spindle = *part.machine.workpiece_spindle;
  return slow_pose(spindle_line(part.truth.actual, spindle), q[spindle], T_wt);
}

/// Returns the last sample at or before an instant; the first sample if there is none.
std::size_t sample_until(const program::Samples& samples, double time_s) {
  const auto after =
      std::ranges::upper_bound(samples.states, time_s, {}, &kinematics::AxisState::time_s);
  return std::size_t(std::max<std::ptrdiff_t>(after - samples.states.begin(), 1) - 1);
}

/// Returns a body with colour and opacity; `close` bodies also appear in the view of the part.
render::FilmBody looking(const render::Colour& colour, double opacity, bool close) {
  render::FilmBody body;
  body.colour = colour;
  body.opacity = opacity;
  body.close = close;
  return body;
}

/// Returns a simple shape as a mesh; chords of cylinders deviate by 0.1 % of their radius.
cutting::ClosedMesh shape_mesh(const render::Body& body) {
  if (const auto* block = std::get_if<render::BlockShape>(&body.shape))
    return cutting::box_mesh(block->size);
  const auto& cylinder = std::get<render::CylinderShape>(body.shape);
  Eigen::MatrixX2d profile(2, 2);
  profile << cylinder.radius, 0.0, cylinder.radius, cylinder.height;
  return cutting::revolved_mesh(profile, 1e-3 * cylinder.radius);
}

/// Returns the corners of a profile, arcs as chords. (n x 2)
Eigen::MatrixX2d chords_of(const cutting::EdgeProfile& profile) {
  // A nose of 180 degrees in 16 chords deviates by 0.5 % of its radius.
  constexpr int of_arc = 16;
  std::vector<Eigen::Vector2d> corners;
  for (const cutting::OutlinePiece& piece : profile.pieces) {
    if (piece.is_arc && piece.radius == 0.0) continue;
    corners.push_back(piece.from);
    for (int i = 1; piece.is_arc && i < of_arc; ++i) {
      const double share = double(i) / of_arc;
      const Eigen::Vector2d normal =
          ((1.0 - share) * piece.normal_from + share * piece.normal_to).normalized();
      corners.push_back(piece.from + piece.radius * (normal - piece.normal_from));
    }
  }
  Eigen::MatrixX2d outline(Eigen::Index(corners.size()), 2);
  for (std::size_t i = 0; i < corners.size(); ++i) outline.row(Eigen::Index(i)) = corners[i];
  return outline;
}

/// Returns the body of a turning tool, which the scene does not describe: its nose below the rake
/// plane, and a bar.
std::vector<cutting::ClosedMesh> turning_tool(const cutting::Nose& nose, double length) {
  const double radius = nose.profile ? 0.5 * nose.profile->outer_radius : nose.radius;
  const double thickness = std::clamp(0.02 * length, 0.4 * radius, 2.0 * radius);
  const double width = std::clamp(0.12 * length, 1.2 * radius, 8.0 * radius);
  Eigen::MatrixX2d disc(2, 2);
  disc << radius, 0.0, radius, thickness;
  Pose below = Pose::Identity();
  below.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;  // z along -y
  Pose behind = Pose::Identity();
  behind.translation() << 0.0, -0.5 * width - thickness, 0.5 * length;
  const cutting::ClosedMesh plate =
      nose.profile ? cutting::extruded_mesh(chords_of(*nose.profile), thickness)
                   : cutting::revolved_mesh(disc, 1e-3 * radius);
  return {cutting::moved(plate, below),
          cutting::moved(cutting::box_mesh({width, width, length}), behind)};
}

/// Returns the corners of the bounding box of points.
cutting::Points corners_of(const cutting::Points& points) {
  cutting::Points corners(8, 3);
  const Eigen::RowVector3d low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  for (int i = 0; i < 8; ++i)
    for (int k = 0; k < 3; ++k) corners(i, k) = (i >> k & 1) != 0 ? high[k] : low[k];
  return corners;
}

void append_transformed(const cutting::Points& points, const Pose& T, std::vector<Vector3d>& to) {
  for (const auto& row : points.rowwise()) to.push_back(T * Vector3d(row.transpose()));
}

cutting::Points points_of(const std::vector<Vector3d>& all) {
  cutting::Points points(Eigen::Index(all.size()), 3);
  for (std::size_t i = 0; i < all.size(); ++i) points.row(Eigen::Index(i)) = all[i].transpose();
  return points;
}

}  // namespace

ProgramFilm::ProgramFilm(const FilmSource& cut, FilmPlan plan, const FilmOptions& options)
    : cut_(cut), plan_(std::move(plan)), words_(cut.job, cut.commands) {
  setting_.width = options.width;
  setting_.height = options.height;
  check_table_range(cut.job, [&] {
    add_moments();
    magnification_ = options.magnification.value_or(round_magnification(part_size(), largest()));
    if (magnification_ != 1.0) add_trace();
  });
  add_bodies();
  add_part();
  set_views();
  set_captions();
}

void ProgramFilm::add_moments() {
  const auto parts = parts_of(cut_.job);
  std::vector<std::vector<std::size_t>> at(parts.size());
  for (const double time : plan_.time_s) {
    std::size_t p = 0;  // the last part that has begun; one may be without samples
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const auto& states = of_part(cut_.commands, i).samples.states;
      if (!states.empty() && (states.front().time_s <= time || i == 0)) p = i;
    }
    Moment moment;
    moment.part = p;
    moment.sample = sample_until(of_part(cut_.commands, p).samples, time);
    at[p].push_back(moment.sample);
    moments_.push_back(std::move(moment));
  }
  std::vector<std::vector<Pose>> T_wt(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (!at[i].empty())
      T_wt[i] = tool_poses(parts[i], of_part(cut_.commands, i), cut_.process, at[i]);
  std::vector<std::size_t> taken(parts.size(), 0);
  for (Moment& moment : moments_) {
    const Job& part = parts[moment.part];
    kinematics::AxisState state = of_part(cut_.commands, moment.part).samples.states[moment.sample];
    const Pose& actual = T_wt[moment.part][taken[moment.part]++];
    const Pose& nominal = nominal_poses(cut_, moment.part)[moment.sample];
    moment.error = (actual.translation() - nominal.translation()).norm();
    moment.T_wt = at_rest(part, state.q, actual);
    moment.T_wt_nominal = at_rest(part, state.q, nominal);
    const auto off = deviations(part.truth, state, load_at(cut_.process, state.time_s)).joints;
    // Between two frames a spindle turns many times, so it is drawn at rest.
    if (const auto spindle = find_spindle(part.machine)) state.q[*spindle] = 0.0;
    moment.carriers_b = carrier_poses(part.truth.actual, state.q, off);
  }
}

void ProgramFilm::add_body(const cutting::ClosedMesh& mesh, const Actor& actor,
                           const render::FilmBody& look) {
  actors_.push_back(actor);
  setting_.bodies.push_back(look);
  setting_.bodies.back().vertices = mesh.vertices;
  setting_.bodies.back().triangles = mesh.triangles;
}

void ProgramFilm::add_tool(std::size_t part, const std::vector<SolidBody>& solids) {
  using Kind = SolidBody::Kind;
  const Job& job = parts_of(cut_.job)[part];
  const Actor actor{Carriers{job.truth.actual.size()}.tool(), part};
  Actor edge = actor;
  edge.cuts = true;
  for (const SolidBody& solid : solids) {
    if (solid.kind == Kind::Cutter) add_body(solid.mesh, edge, looking(cutter_colour, 1.0, true));
    if (solid.kind == Kind::Shank) add_body(solid.mesh, actor, looking(shank_colour, 1.0, true));
    if (solid.kind == Kind::Holder) add_body(solid.mesh, actor, looking(holder_colour, 1.0, true));
  }
  const auto* nose = std::get_if<cutting::Nose>(&job.scene.tool.actual);
  if (nose == nullptr) return;
  const auto pieces = turning_tool(*nose, job.scene.tool.actual_length);
  add_body(pieces[0], edge, looking(cutter_colour, 1.0, true));
  add_body(pieces[1], actor, looking(shank_colour, 1.0, true));
}

void ProgramFilm::add_bodies() {
  const Job& first = parts_of(cut_.job).front();
  const auto& joints = first.machine.nominal.joints();
  const auto parts = parts_of(cut_.job);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const std::vector<SolidBody> solids = job_bodies(parts[p]);
    for (const SolidBody& solid : solids) {
      if (p > 0) break;
      if (solid.kind == SolidBody::Kind::Fixture)
        add_body(solid.mesh, {solid.frame}, looking(clamp_colour, 1.0, true));
      if (solid.kind != SolidBody::Kind::Machine) continue;
      const bool on_bed = solid.frame == Carriers::bed;
      const bool turns =
          !on_bed && joints[std::size_t(solid.frame) - 1].motion != kinematics::Motion::Linear;
      add_body(solid.mesh, {solid.frame},
               looking(on_bed  ? bed_colour
                       : turns ? turn_colour
                               : slide_colour,
                       0.55, false));
    }
    add_tool(p, solids);
  }
  if (!first.scene.machine.bodies.empty()) return;
  for (const SchematicBody& one : schematic_bodies(first))
    add_body(shape_mesh(one.body), {one.frame, {}, one.body.T},
             looking(one.body.colour, one.body.opacity, false));
}

void ProgramFilm::add_part() {
  const Job& job = cut_.job;
  const bool has_stock = cut_.process.stock || cut_.process.turned;
  setting_.looks = {{has_stock ? "raw material" : "not yet cut", raw_colour},
                    {"cut", fresh_colour}};
  if (has_stock) {
    stock_.emplace(job, of_part(cut_.commands, 0), cut_.process);
    const std::string name = cut_.process.crash_lines.empty() ? "" : "cut by a crash";
    setting_.looks.push_back({name, crash_colour});
    return;
  }
  design_ = std::make_shared<const render::FilmMesh>(
      render::FilmMesh{job.design_w.vertices, job.design_w.normals, job.design_w.triangles});
}

/// Samples at which a path is drawn, with the number of the pass of each.
struct ProgramFilm::TracedSamples {
  std::vector<std::size_t> at;
  std::vector<int> pass;
};

double ProgramFilm::part_size() const {
  const auto& vertices = cut_.job.design_w.vertices;
  return (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).norm();
}

Vector3d ProgramFilm::nominal_tip(std::size_t part, std::size_t sample) const {
  const AxisVector& q = of_part(cut_.commands, part).samples.states[sample].q;
  return at_rest(parts_of(cut_.job)[part], q, nominal_poses(cut_, part)[sample]).translation();
}

ProgramFilm::TracedSamples ProgramFilm::traced_path_samples(std::size_t part) {
  const program::Samples& samples = of_part(cut_.commands, part).samples;
  // A 300th of the part is one or two pixels of a frame; a pass ends when it is longer than the
  // part, so that passes can be thinned one by one.
  const double size = part_size(), step = size / 300.0, longest = 1.2 * size;
  constexpr double sharp = 0.2;  // rad
  TracedSamples traced;
  const auto take = [&](std::size_t i) {
    traced.at.push_back(i);
    traced.pass.push_back(trace_.passes - 1);
  };
  double length = 0.0;
  bool feeds = false;
  Vector3d last = Vector3d::Zero(), way = Vector3d::Zero();
  for (std::size_t i = 0; i < samples.states.size(); ++i) {
    const double time = samples.states[i].time_s;
    const bool fed = std::exchange(
        feeds, time >= plan_.stretch.begin_s && time <= plan_.stretch.end_s &&
                   is_feed(part_path(cut_, part).blocks[std::size_t(samples.block[i])]));
    if (!feeds) continue;
    const Vector3d now = nominal_tip(part, i);
    const double moved = fed ? (now - last).norm() : 0.0;
    const bool begins = !fed || length > longest;
    if (!begins && moved < step && kinematics::angle_between(way, now - last) < sharp) continue;
    if (begins && fed) take(i);  // a pass ends where the next one begins
    if (begins) ++trace_.passes;
    take(i);
    length = begins ? 0.0 : length + moved;
    if (moved > 0.0) way = now - last;
    last = now;
  }
  return traced;
}

void ProgramFilm::add_trace() {
  const auto parts = parts_of(cut_.job);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const Commands& commands = of_part(cut_.commands, p);
    const TracedSamples traced = traced_path_samples(p);
    if (traced.at.empty()) continue;
    const std::vector<Pose> T_wt = tool_poses(parts[p], commands, cut_.process, traced.at);
    for (std::size_t k = 0; k < traced.at.size(); ++k) {
      const kinematics::AxisState& state = commands.samples.states[traced.at[k]];
      const Vector3d on = nominal_tip(p, traced.at[k]);
      const Vector3d is = at_rest(parts[p], state.q, T_wt[k]).translation();
      trace_.points.push_back({state.time_s, on, on + magnification_ * (is - on), traced.pass[k]});
    }
  }
}

kinematics::Pose ProgramFilm::tool_pose(const Moment& moment) const {
  const double times = magnification_;
  if (times == 1.0) return moment.T_wt;
  const Pose &on = moment.T_wt_nominal, &is = moment.T_wt;
  Pose T = on;
  T.translation() += times * (is.translation() - on.translation());
  const Eigen::AngleAxisd off(is.linear() * on.linear().transpose());
  T.linear() = Eigen::AngleAxisd(times * off.angle(), off.axis()).toRotationMatrix() * on.linear();
  return T;
}

const Pose& ProgramFilm::workpiece_in_bed(const Moment& moment) const {
  const Carriers carriers{parts_of(cut_.job)[moment.part].truth.actual.size()};
  return moment.carriers_b[std::size_t(carriers.workpiece())];
}

double ProgramFilm::largest() const {
  double error = 0.0;
  for (const Moment& moment : moments_) error = std::max(error, moment.error);
  return error;
}

double ProgramFilm::end_s() const {
  double end = 0.0;
  for (std::size_t i = 0; i < parts_of(cut_.job).size(); ++i) {
    const auto& states = of_part(cut_.commands, i).samples.states;
    if (!states.empty()) end = std::max(end, states.back().time_s);
  }
  return end;
}

bool ProgramFilm::is_feeding(const Moment& moment) const {
  const program::Samples& samples = of_part(cut_.commands, moment.part).samples;
  return is_feed(part_path(cut_, moment.part).blocks[std::size_t(samples.block[moment.sample])]);
}

void ProgramFilm::set_views() {
  std::vector<cutting::Points> corners;
  for (const render::FilmBody& body : setting_.bodies) corners.push_back(corners_of(body.vertices));
  const bool feeds = std::ranges::any_of(moments_, [&](const Moment& m) { return is_feeding(m); });
  const cutting::Points part =
      stock_ ? stock_->mesh().vertices_w : cutting::Points(cut_.job.design_w.vertices);
  std::vector<Vector3d> all_b, part_w, close_w;
  append_transformed(part, Pose::Identity(), part_w);
  for (const Trace::Point& point : trace_.points)
    part_w.insert(part_w.end(), {point.nominal_w, point.actual_w});
  for (const Moment& moment : moments_) {
    const Pose& T_bw = workpiece_in_bed(moment);
    append_transformed(corners_of(part), T_bw, all_b);
    for (std::size_t i = 0; i < actors_.size(); ++i) {
      const Actor& actor = actors_[i];
      if (actor.part && *actor.part != moment.part) continue;
      const Pose T_wt = tool_pose(moment);
      append_transformed(
          corners[i],
          actor.part ? T_bw * T_wt : moment.carriers_b[std::size_t(actor.frame)] * actor.T, all_b);
      if (!actor.part) continue;
      append_transformed(corners[i], T_wt, close_w);
      if (actor.cuts && (is_feeding(moment) || !feeds))
        append_transformed(corners[i], T_wt, part_w);
    }
  }
  setting_.machine_b = points_of(all_b);
  setting_.part_w = points_of(part_w);
  const Vector3d middle = setting_.part_w.colwise().mean().transpose();
  for (const Vector3d& p : close_w)
    setting_.part_depth = std::max(setting_.part_depth, 1.1 * (p - middle).norm());
  const ViewDescription& view = cut_.job.scene.view;
  setting_.from_w = cut_.job.scene.part.T_wm.linear() * view.from;
  setting_.up_w = cut_.job.scene.part.T_wm.linear() * view.up;
}

void ProgramFilm::set_captions() {
  const Scene& scene = cut_.job.scene;
  setting_.title = scene.title.empty() ? scene.file.stem().string() : scene.title;
  setting_.subtitle = speed_text(plan_);
  if (magnification_ != 1.0) {
    setting_.subtitle += fmt::format(", errors magnified {:.4g} ×", magnification_);
    setting_.lines = {{"tip as programmed", nominal_path},
                      {"tip on the wrong machine", actual_path}};
  }
  setting_.machine_name =
      scene.machine.bodies.empty()
          ? scene.machine.name + ", schematic: its description gives it no bodies"
          : scene.machine.name;
  setting_.part_name = cut_.job.machine.workpiece_spindle
                           ? "part and tool, the spindle drawn at rest"
                           : "part and tool, seen by an eye that goes with the part";
  setting_.labels = {{"program line", 0.13}, {"time", 0.20},       {"feed", 0.14},
                     {"spindle", 0.12},      {"tool error", 0.12}, {"tool", 0.29}};
}

std::vector<std::string> ProgramFilm::values(const Moment& moment, double time_s) const {
  const Job& part = parts_of(cut_.job)[moment.part];
  const program::Samples& samples = of_part(cut_.commands, moment.part).samples;
  const program::Block& block =
      part_path(cut_, moment.part).blocks[std::size_t(samples.block[moment.sample])];
  const auto& states = samples.states;
  // The speed is that of one block: its neighbour sample must be in the same block.
  std::size_t before = moment.sample, after = std::min(moment.sample + 1, states.size() - 1);
  if (samples.block[after] != samples.block[before] && before > 0) after = before--;
  const double duration = states[after].time_s - states[before].time_s;
  const double speed =
      duration > 0.0
          ? (nominal_tip(moment.part, after) - nominal_tip(moment.part, before)).norm() / duration
          : 0.0;
  const std::string feed = block.interpolation == program::Interpolation::Rapid ? "rapid"
                           : block.interpolation == program::Interpolation::Dwell
                               ? "dwell"
                               : fmt::format("{:.0f} mm/min", 60.0 * speed);
  const double rpm = states[moment.sample].spindle_speed * 60.0 / (2.0 * pi);
  std::string tool = part.scene.tool.name;
  if (part.scene.tool.number) tool = fmt::format("T{} {}", *part.scene.tool.number, tool);
  return {std::to_string(samples.line[moment.sample]),
          fmt::format("{:.1f} s of {:.1f} s", time_s, end_s()),
          feed,
          rpm > 0.0 ? fmt::format("{:.0f} rpm", rpm) : "at rest",
          fmt::format("{:.1f} µm", moment.error / units::um),
          tool};
}

std::vector<render::Wire> ProgramFilm::paths(double time_s) const {
  constexpr int max_passes = 24;
  const int every = (trace_.passes + max_passes - 1) / max_passes;
  const auto end = std::ranges::upper_bound(trace_.points, time_s, {}, &Trace::Point::time_s);
  if (end == trace_.points.begin()) return {};
  const int current = (end - 1)->pass;
  std::vector<Vector3d> nominal, actual;
  std::vector<std::array<int, 2>> segments;
  int before = -1;
  for (auto point = trace_.points.begin(); point != end; ++point) {
    if (point->pass != current && point->pass % std::max(1, every) != every / 2) continue;
    if (point->pass == before) segments.push_back({int(nominal.size()) - 1, int(nominal.size())});
    nominal.push_back(point->nominal_w);
    actual.push_back(point->actual_w);
    before = point->pass;
  }
  return {{points_of(nominal), segments, nominal_path, 1.5},
          {points_of(actual), segments, actual_path, 1.5}};
}

void ProgramFilm::show_part(double time_s, render::FilmState& state) {
  if (stock_) {
    if (stock_->advance_to(time_s) || stock_mesh_ == nullptr) {
      cutting::StockMesh mesh = stock_->mesh();
      stock_styles_.clear();
      for (const std::int32_t line : mesh.line)
        stock_styles_.push_back(line > 0 ? fresh_style : line < 0 ? crash_style : raw_style);
      stock_mesh_ = std::make_shared<const render::FilmMesh>(
          render::FilmMesh{std::move(mesh.vertices_w), {}, std::move(mesh.triangles), true});
    }
    state.part = stock_mesh_;
    state.looks = stock_styles_;
    return;
  }
  state.part = design_;
  state.looks.assign(std::size_t(design_->vertices.rows()), raw_style);
  if (cut_.surface == nullptr) return;
  const auto& cut_at = cut_.surface->cut_time_s;
  for (Eigen::Index i = 0; i < cut_at.size(); ++i)
    if (cut_at[i] <= time_s) state.looks[std::size_t(i)] = fresh_style;  // never where it is NaN
}

render::FilmState ProgramFilm::state(std::size_t frame) {
  const Moment& moment = moments_.at(frame);
  const double time_s = plan_.time_s[frame];
  render::FilmState state;
  state.T_bw = workpiece_in_bed(moment);
  for (const Actor& actor : actors_) {
    if (!actor.part)
      state.T_b.emplace_back(moment.carriers_b[std::size_t(actor.frame)] * actor.T);
    else if (*actor.part == moment.part)
      state.T_b.emplace_back(state.T_bw * tool_pose(moment));
    else
      state.T_b.emplace_back(std::nullopt);
  }
  const program::Samples& samples = of_part(cut_.commands, moment.part).samples;
  state.text =
      words_.of(part_path(cut_, moment.part).blocks[std::size_t(samples.block[moment.sample])]);
  state.values = values(moment, time_s);
  if (!trace_.points.empty()) state.paths = paths(time_s);
  show_part(time_s, state);
  state.done = end_s() > 0.0 ? time_s / end_s() : 1.0;
  return state;
}

}  // namespace abbe::sim

#endif
