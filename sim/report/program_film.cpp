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

std::optional<FilmInterval> line_time_interval(const program::Path& path,
                                               const std::optional<LineRange>& lines) {
  std::optional<FilmInterval> interval;
  for (const program::Block& block : path.blocks) {
    if (lines && (block.file != 0 || block.line < lines->first || block.line > lines->last))
      continue;
    if (!interval) interval = FilmInterval{block.start_s, block.end_s};
    interval->end_s = std::max(interval->end_s, block.end_s);
  }
  return interval;
}

FilmPlan film_plan(const FilmInterval& interval, double seconds, double fps) {
  FilmPlan plan{interval, {}, fps};
  const auto count = std::max(1L, std::lround(seconds * fps));
  for (long k = 0; k < count; ++k) {
    // The last frame is exactly the end, without rounding.
    const double u = count > 1 ? double(k) / double(count - 1) : 1.0;
    plan.time_s.push_back(k + 1 == count
                              ? interval.end_s
                              : interval.begin_s + u * (interval.end_s - interval.begin_s));
  }
  return plan;
}

double speed_factor(const FilmPlan& plan) {
  return (plan.interval.end_s - plan.interval.begin_s) * plan.fps / double(plan.time_s.size());
}

std::string speed_text(const FilmPlan& plan) {
  const double factor = speed_factor(plan);
  const auto number = [](double x) { return fmt::format("{:.{}f}", x, x < 10.0 ? 1 : 0); };
  if (!(factor > 0.0)) return "one instant of the program";
  // Within 5 % of real time the factor would only distract.
  if (factor >= 1.05) return number(factor) + " × faster than real time";
  if (factor <= 1.0 / 1.05) return number(1.0 / factor) + " × slower than real time";
  return "in real time";
}

namespace {

constexpr std::size_t max_line_bytes = 200;  // bytes

/// Reads lines, shortened to the length of a caption.
std::vector<std::string> text_lines(std::istream& in) {
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) {
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    line.resize(std::min(line.size(), max_line_bytes));
    lines.push_back(std::move(line));
  }
  return lines;
}

/// Returns the lines of a program file. Empty if the file cannot be read, because the film only
/// quotes them.
std::vector<std::string> read_program_lines(const std::filesystem::path& file) {
  // Quotes are not worth more memory.
  constexpr std::uintmax_t max_bytes = std::uintmax_t(256) << 20;
  std::error_code failure;
  const std::uintmax_t size = std::filesystem::file_size(file, failure);
  if (failure || size > max_bytes) return {};
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
  for (const std::string& subprogram : path_of(job, commands).subprogram_files)
    files_.push_back(read_program_lines(subprogram));
}

std::string ProgramText::line(const program::Block& block) const {
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

enum StockStyle : std::uint8_t { raw_style, fresh_style, crash_style };

/// Returns the program that a segment of the job executes in this case.
const program::Path& segment_path(const FilmSource& source, std::size_t segment) {
  return path_of(job_segments(source.job)[segment], part_commands(source.commands, segment));
}

/// Returns the target poses of a segment of the job.
const std::vector<Pose>& nominal_poses(const FilmSource& source, std::size_t segment) {
  return target_poses(job_segments(source.job)[segment], part_commands(source.commands, segment));
}

/// Returns the pose of the tool relative to a workpiece spindle that does not rotate.
Pose pose_at_rest(const Segment& segment, const AxisVector& q, const Pose& T_wt) {
  if (!segment.machine.workpiece_spindle) return T_wt;
  const int spindle = *segment.machine.workpiece_spindle;
  return slow_pose(spindle_line(segment.truth.actual, spindle), q[spindle], T_wt);
}

/// Returns the index of the last sample at or before a time; 0 if there is none.
std::size_t sample_index_at(const program::Samples& samples, double time_s) {
  const auto next =
      std::ranges::upper_bound(samples.states, time_s, {}, &kinematics::AxisState::time_s);
  return std::size_t(std::max<std::ptrdiff_t>(next - samples.states.begin(), 1) - 1);
}

/// Returns the style of a body; `in_close_up` bodies also appear in the view of the part.
render::FilmBody film_body(const render::Colour& colour, double opacity, bool in_close_up) {
  render::FilmBody body;
  body.colour = colour;
  body.opacity = opacity;
  body.in_close_up = in_close_up;
  return body;
}

/// Returns a block or a cylinder as a mesh. The chords of a cylinder deviate by 0.1 % of its
/// radius.
cutting::ClosedMesh shape_mesh(const render::Body& body) {
  if (const auto* block = std::get_if<render::BlockShape>(&body.shape))
    return cutting::box_mesh(block->size);
  const auto& cylinder = std::get<render::CylinderShape>(body.shape);
  Eigen::MatrixX2d profile(2, 2);
  profile << cylinder.radius, 0.0, cylinder.radius, cylinder.height;
  return cutting::revolved_mesh(profile, 1e-3 * cylinder.radius);
}

/// Returns the corners of a profile whose arcs are replaced by chords. (n x 2)
Eigen::MatrixX2d outline_corners(const cutting::EdgeProfile& profile) {
  // 16 chords of a nose of 180 degrees deviate by 0.5 % of its radius.
  constexpr int chord_count = 16;
  std::vector<Eigen::Vector2d> corners;
  for (const cutting::OutlineSegment& piece : profile.segments) {
    if (piece.is_arc && piece.radius == 0.0) continue;
    corners.push_back(piece.from);
    for (int i = 1; piece.is_arc && i < chord_count; ++i) {
      const double fraction = double(i) / chord_count;
      const Eigen::Vector2d normal =
          ((1.0 - fraction) * piece.normal_from + fraction * piece.normal_to).normalized();
      corners.push_back(piece.from + piece.radius * (normal - piece.normal_from));
    }
  }
  Eigen::MatrixX2d outline(Eigen::Index(corners.size()), 2);
  for (std::size_t i = 0; i < corners.size(); ++i) outline.row(Eigen::Index(i)) = corners[i];
  return outline;
}

/// Returns assumed bodies of a turning tool, of which the scene describes only the nose: a plate
/// with the nose below the rake plane, and a bar as holder.
std::vector<cutting::ClosedMesh> turning_tool(const cutting::Nose& nose, double length) {
  const double radius = nose.profile ? 0.5 * nose.profile->outer_radius : nose.radius;
  const double thickness = std::clamp(0.02 * length, 0.4 * radius, 2.0 * radius);
  const double width = std::clamp(0.12 * length, 1.2 * radius, 8.0 * radius);
  Eigen::MatrixX2d disc(2, 2);
  disc << radius, 0.0, radius, thickness;
  Pose T_plate = Pose::Identity();
  T_plate.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;  // z along -y
  Pose T_bar = Pose::Identity();
  T_bar.translation() << 0.0, -0.5 * width - thickness, 0.5 * length;
  const cutting::ClosedMesh plate =
      nose.profile ? cutting::extruded_mesh(outline_corners(*nose.profile), thickness)
                   : cutting::revolved_mesh(disc, 1e-3 * radius);
  return {cutting::transformed_mesh(plate, T_plate),
          cutting::transformed_mesh(cutting::box_mesh({width, width, length}), T_bar)};
}

/// Returns the corners of the bounding box of points.
cutting::Points box_corners(const cutting::Points& points) {
  cutting::Points corners(8, 3);
  const Eigen::RowVector3d low = points.colwise().minCoeff(), high = points.colwise().maxCoeff();
  for (int i = 0; i < 8; ++i)
    for (int k = 0; k < 3; ++k) corners(i, k) = (i >> k & 1) != 0 ? high[k] : low[k];
  return corners;
}

/// Appends points that are transformed by T.
void append_transformed(const cutting::Points& points, const Pose& T,
                        std::vector<Vector3d>& transformed) {
  for (const auto& row : points.rowwise()) transformed.push_back(T * Vector3d(row.transpose()));
}

cutting::Points point_matrix(const std::vector<Vector3d>& positions) {
  cutting::Points points(Eigen::Index(positions.size()), 3);
  for (std::size_t i = 0; i < positions.size(); ++i)
    points.row(Eigen::Index(i)) = positions[i].transpose();
  return points;
}

}  // namespace

ProgramFilm::ProgramFilm(const FilmSource& source, FilmPlan plan, const FilmOptions& options)
    : source_(source), plan_(std::move(plan)), program_text_(source.job, source.commands) {
  setting_.width = options.width;
  setting_.height = options.height;
  check_table_range(source.job, [&] {
    add_frame_samples();
    magnification_ = options.magnification.value_or(round_magnification(part_size(), max_error()));
    if (magnification_ != 1.0) add_trace();
  });
  add_bodies();
  add_part();
  set_views();
  set_captions();
}

void ProgramFilm::add_frame_samples() {
  const auto segments = job_segments(source_.job);
  std::vector<std::vector<std::size_t>> sample_indices(segments.size());
  for (const double time : plan_.time_s) {
    std::size_t segment = 0;  // the last segment that has begun; segments may have no samples
    for (std::size_t i = 0; i < segments.size(); ++i) {
      const auto& states = part_commands(source_.commands, i).samples.states;
      if (!states.empty() && (states.front().time_s <= time || i == 0)) segment = i;
    }
    FrameSample frame_sample;
    frame_sample.segment = segment;
    frame_sample.sample = sample_index_at(part_commands(source_.commands, segment).samples, time);
    sample_indices[segment].push_back(frame_sample.sample);
    frame_samples_.push_back(std::move(frame_sample));
  }
  std::vector<Process> processes;
  for (std::size_t i = 0; i < segments.size(); ++i)
    processes.push_back(part_process(source_.process, i));
  std::vector<std::vector<Pose>> T_wt(segments.size());
  for (std::size_t i = 0; i < segments.size(); ++i)
    if (!sample_indices[i].empty())
      T_wt[i] = tool_poses(segments[i], part_commands(source_.commands, i), processes[i],
                           sample_indices[i]);
  std::vector<std::size_t> next_pose(segments.size(), 0);
  for (FrameSample& frame_sample : frame_samples_) {
    const Segment& segment = segments[frame_sample.segment];
    kinematics::AxisState state =
        part_commands(source_.commands, frame_sample.segment).samples.states[frame_sample.sample];
    const Pose& actual = T_wt[frame_sample.segment][next_pose[frame_sample.segment]++];
    const Pose& nominal = nominal_poses(source_, frame_sample.segment)[frame_sample.sample];
    frame_sample.error = (actual.translation() - nominal.translation()).norm();
    frame_sample.T_wt = pose_at_rest(segment, state.q, actual);
    frame_sample.T_wt_nominal = pose_at_rest(segment, state.q, nominal);
    const auto axis_deviations =
        deviations(segment.truth, state, load_at(processes[frame_sample.segment], state.time_s))
            .joints;
    if (const auto spindle = find_spindle(segment.machine)) state.q[*spindle] = 0.0;
    frame_sample.carriers_b = carrier_poses(segment.truth.actual, state.q, axis_deviations);
  }
}

void ProgramFilm::add_body(const cutting::ClosedMesh& mesh, const Attachment& attachment,
                           const render::FilmBody& style) {
  attachments_.push_back(attachment);
  setting_.bodies.push_back(style);
  setting_.bodies.back().vertices = mesh.vertices;
  setting_.bodies.back().triangles = mesh.triangles;
}

void ProgramFilm::add_tool(std::size_t number, const std::vector<SolidBody>& solids) {
  using Kind = SolidBody::Kind;
  const Segment& segment = job_segments(source_.job)[number];
  const Attachment attachment{Carriers{segment.truth.actual.size()}.tool(), number};
  Attachment cutting_part = attachment;
  cutting_part.is_cutting_part = true;
  for (const SolidBody& solid : solids) {
    if (solid.kind == Kind::Cutter)
      add_body(solid.mesh, cutting_part, film_body(cutter_colour, 1.0, true));
    if (solid.kind == Kind::Shank)
      add_body(solid.mesh, attachment, film_body(shank_colour, 1.0, true));
    if (solid.kind == Kind::Holder)
      add_body(solid.mesh, attachment, film_body(holder_colour, 1.0, true));
  }
  const auto* nose = std::get_if<cutting::Nose>(&segment.scene.tool.actual);
  if (nose == nullptr) return;
  const auto meshes = turning_tool(*nose, segment.scene.tool.actual_length);
  add_body(meshes[0], cutting_part, film_body(cutter_colour, 1.0, true));
  add_body(meshes[1], attachment, film_body(shank_colour, 1.0, true));
}

void ProgramFilm::add_bodies() {
  const Segment& first = job_segments(source_.job).front();
  const auto& joints = first.machine.nominal.joints();
  const auto segments = job_segments(source_.job);
  for (std::size_t segment = 0; segment < segments.size(); ++segment) {
    const std::vector<SolidBody> solids = segment_bodies(source_.job, segments[segment]);
    for (const SolidBody& solid : solids) {
      if (segment > 0) break;
      if (solid.kind == SolidBody::Kind::Fixture)
        add_body(solid.mesh, {solid.frame}, film_body(clamp_colour, 1.0, true));
      if (solid.kind != SolidBody::Kind::Machine) continue;
      const bool on_bed = solid.frame == Carriers::bed;
      const bool is_rotary =
          !on_bed && joints[std::size_t(solid.frame) - 1].motion != kinematics::Motion::Linear;
      add_body(solid.mesh, {solid.frame},
               film_body(on_bed      ? bed_colour
                         : is_rotary ? turn_colour
                                     : slide_colour,
                         0.55, false));
    }
    add_tool(segment, solids);
  }
  if (!first.scene.machine.bodies.empty()) return;
  for (const SchematicBody& schematic : schematic_bodies(first.machine, source_.job.design_w))
    add_body(shape_mesh(schematic.body), {schematic.frame, {}, schematic.body.T},
             film_body(schematic.body.colour, schematic.body.opacity, false));
}

void ProgramFilm::add_part() {
  const Job& job = source_.job;
  const bool has_stock = source_.process.stock || source_.process.turned;
  setting_.vertex_styles = {{has_stock ? "raw material" : "not yet cut", raw_colour},
                            {"cut", fresh_colour}};
  if (has_stock) {
    stock_.emplace(job, source_.commands, source_.process);
    const std::string name = source_.process.crash_lines.empty() ? "" : "cut in a crash";
    setting_.vertex_styles.push_back({name, crash_colour});
    return;
  }
  design_ = std::make_shared<const render::FilmMesh>(
      render::FilmMesh{job.design_w.vertices, job.design_w.normals, job.design_w.triangles});
}

/// Samples at which a path is drawn, each with the number of its pass.
struct ProgramFilm::TracedSamples {
  std::vector<std::size_t> sample;
  std::vector<int> pass;
};

double ProgramFilm::part_size() const {
  const auto& vertices = source_.job.design_w.vertices;
  return (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).norm();
}

Vector3d ProgramFilm::nominal_tip(std::size_t segment, std::size_t sample) const {
  const AxisVector& q = part_commands(source_.commands, segment).samples.states[sample].q;
  return pose_at_rest(job_segments(source_.job)[segment], q,
                      nominal_poses(source_, segment)[sample])
      .translation();
}

ProgramFilm::TracedSamples ProgramFilm::traced_path_samples(std::size_t segment) {
  const program::Samples& samples = part_commands(source_.commands, segment).samples;
  // 1/300 of the part is one or two pixels of a frame. A pass is divided when it becomes longer
  // than the part, because whole passes are left out if there are too many.
  const double size = part_size(), step = size / 300.0, max_length = 1.2 * size;
  constexpr double min_turn = 0.2;  // rad
  TracedSamples traced;
  const auto add_sample = [&](std::size_t i) {
    traced.sample.push_back(i);
    traced.pass.push_back(trace_.passes - 1);
  };
  double length = 0.0;
  bool is_feeding_now = false;
  Vector3d last_tip = Vector3d::Zero(), displacement = Vector3d::Zero();
  for (std::size_t i = 0; i < samples.states.size(); ++i) {
    const double time = samples.states[i].time_s;
    const bool was_feeding = std::exchange(
        is_feeding_now, time >= plan_.interval.begin_s && time <= plan_.interval.end_s &&
                            is_feed_sample(segment_path(source_, segment), samples, i));
    if (!is_feeding_now) continue;
    const Vector3d tip = nominal_tip(segment, i);
    const double distance = was_feeding ? (tip - last_tip).norm() : 0.0;
    const bool begins_pass = !was_feeding || length > max_length;
    if (!begins_pass && distance < step &&
        kinematics::angle_between(displacement, tip - last_tip) < min_turn)
      continue;
    if (begins_pass && was_feeding) add_sample(i);  // a divided pass ends where the next one begins
    if (begins_pass) ++trace_.passes;
    add_sample(i);
    length = begins_pass ? 0.0 : length + distance;
    if (distance > 0.0) displacement = tip - last_tip;
    last_tip = tip;
  }
  return traced;
}

void ProgramFilm::add_trace() {
  const auto segments = job_segments(source_.job);
  for (std::size_t segment = 0; segment < segments.size(); ++segment) {
    const Commands& commands = part_commands(source_.commands, segment);
    const TracedSamples traced = traced_path_samples(segment);
    if (traced.sample.empty()) continue;
    const std::vector<Pose> T_wt = tool_poses(
        segments[segment], commands, part_process(source_.process, segment), traced.sample);
    for (std::size_t k = 0; k < traced.sample.size(); ++k) {
      const kinematics::AxisState& state = commands.samples.states[traced.sample[k]];
      const Vector3d nominal = nominal_tip(segment, traced.sample[k]);
      const Vector3d actual = pose_at_rest(segments[segment], state.q, T_wt[k]).translation();
      trace_.points.push_back(
          {state.time_s, nominal, nominal + magnification_ * (actual - nominal), traced.pass[k]});
    }
  }
}

kinematics::Pose ProgramFilm::tool_pose(const FrameSample& frame_sample) const {
  if (magnification_ == 1.0) return frame_sample.T_wt;
  const Pose &nominal = frame_sample.T_wt_nominal, &actual = frame_sample.T_wt;
  Pose T = nominal;
  T.translation() += magnification_ * (actual.translation() - nominal.translation());
  const Eigen::AngleAxisd error(actual.linear() * nominal.linear().transpose());
  T.linear() = Eigen::AngleAxisd(magnification_ * error.angle(), error.axis()).toRotationMatrix() *
               nominal.linear();
  return T;
}

const Pose& ProgramFilm::workpiece_in_bed(const FrameSample& frame_sample) const {
  const Carriers carriers{job_segments(source_.job)[frame_sample.segment].truth.actual.size()};
  return frame_sample.carriers_b[std::size_t(carriers.workpiece())];
}

double ProgramFilm::max_error() const {
  double error = 0.0;
  for (const FrameSample& frame_sample : frame_samples_)
    error = std::max(error, frame_sample.error);
  return error;
}

double ProgramFilm::end_s() const {
  double end = 0.0;
  for (std::size_t i = 0; i < job_segments(source_.job).size(); ++i) {
    const auto& states = part_commands(source_.commands, i).samples.states;
    if (!states.empty()) end = std::max(end, states.back().time_s);
  }
  return end;
}

bool ProgramFilm::is_feeding(const FrameSample& frame_sample) const {
  const program::Samples& samples = part_commands(source_.commands, frame_sample.segment).samples;
  return is_feed_sample(segment_path(source_, frame_sample.segment), samples, frame_sample.sample);
}

void ProgramFilm::set_views() {
  std::vector<cutting::Points> corners;
  for (const render::FilmBody& body : setting_.bodies)
    corners.push_back(box_corners(body.vertices));
  const bool has_feed = std::ranges::any_of(
      frame_samples_, [&](const FrameSample& sample) { return is_feeding(sample); });
  const cutting::Points part =
      stock_ ? stock_->mesh().vertices_w : cutting::Points(source_.job.design_w.vertices);
  std::vector<Vector3d> bodies_b, part_w, close_w;
  append_transformed(part, Pose::Identity(), part_w);
  for (const Trace::Point& point : trace_.points)
    part_w.insert(part_w.end(), {point.nominal_w, point.actual_w});
  for (const FrameSample& frame_sample : frame_samples_) {
    const Pose& T_bw = workpiece_in_bed(frame_sample);
    append_transformed(box_corners(part), T_bw, bodies_b);
    for (std::size_t i = 0; i < attachments_.size(); ++i) {
      const Attachment& attachment = attachments_[i];
      if (attachment.segment && *attachment.segment != frame_sample.segment) continue;
      const Pose T_wt = tool_pose(frame_sample);
      append_transformed(
          corners[i],
          attachment.segment
              ? T_bw * T_wt
              : frame_sample.carriers_b[std::size_t(attachment.frame)] * attachment.T,
          bodies_b);
      if (!attachment.segment) continue;
      append_transformed(corners[i], T_wt, close_w);
      if (attachment.is_cutting_part && (is_feeding(frame_sample) || !has_feed))
        append_transformed(corners[i], T_wt, part_w);
    }
  }
  setting_.machine_b = point_matrix(bodies_b);
  setting_.part_w = point_matrix(part_w);
  const Vector3d middle = setting_.part_w.colwise().mean().transpose();
  for (const Vector3d& p : close_w)
    setting_.part_depth = std::max(setting_.part_depth, 1.1 * (p - middle).norm());
  const ViewDescription& view = source_.job.scene.view;
  setting_.from_w = source_.job.scene.part.T_wm.linear() * view.from;
  setting_.up_w = source_.job.scene.part.T_wm.linear() * view.up;
}

void ProgramFilm::set_captions() {
  const Scene& scene = source_.job.scene;
  setting_.title = scene.title.empty() ? scene.file.stem().string() : scene.title;
  setting_.subtitle = speed_text(plan_);
  if (magnification_ != 1.0) {
    setting_.subtitle += fmt::format(", errors magnified {:.4g} ×", magnification_);
    setting_.lines = {{"tip as programmed", nominal_path}, {"actual tip", actual_path}};
  }
  setting_.machine_name = scene.machine.bodies.empty()
                              ? scene.machine.name + ", schematic: its description has no bodies"
                              : scene.machine.name;
  setting_.part_name = source_.job.machine.workpiece_spindle
                           ? "part and tool, spindle drawn at rest"
                           : "part and tool, in the frame of the part";
  setting_.labels = {{"program line", 0.13}, {"time", 0.20},       {"feed", 0.14},
                     {"spindle", 0.12},      {"tool error", 0.12}, {"tool", 0.29}};
}

std::vector<std::string> ProgramFilm::values(const FrameSample& frame_sample, double time_s) const {
  const Segment& segment = job_segments(source_.job)[frame_sample.segment];
  const program::Samples& samples = part_commands(source_.commands, frame_sample.segment).samples;
  const program::Block& block = segment_path(source_, frame_sample.segment)
                                    .blocks[std::size_t(samples.block[frame_sample.sample])];
  const auto& states = samples.states;
  // The speed is that of one block, so the neighbour sample must be in the same block.
  std::size_t first = frame_sample.sample,
              second = std::min(frame_sample.sample + 1, states.size() - 1);
  if (samples.block[second] != samples.block[first] && first > 0) second = first--;
  const double duration = states[second].time_s - states[first].time_s;
  const double speed =
      duration > 0.0
          ? (nominal_tip(frame_sample.segment, second) - nominal_tip(frame_sample.segment, first))
                    .norm() /
                duration
          : 0.0;
  const std::string feed = block.interpolation == program::Interpolation::Rapid ? "rapid"
                           : block.interpolation == program::Interpolation::Dwell
                               ? "dwell"
                               : fmt::format("{:.0f} mm/min", 60.0 * speed);
  const double rpm = states[frame_sample.sample].spindle_speed * 60.0 / (2.0 * pi);
  std::string tool = segment.scene.tool.name;
  if (segment.scene.tool.number) tool = fmt::format("T{} {}", *segment.scene.tool.number, tool);
  return {std::to_string(samples.line[frame_sample.sample]),
          fmt::format("{:.1f} s of {:.1f} s", time_s, end_s()),
          feed,
          rpm > 0.0 ? fmt::format("{:.0f} rpm", rpm) : "at rest",
          fmt::format("{:.1f} µm", frame_sample.error / units::um),
          tool};
}

std::vector<render::Wire> ProgramFilm::paths(double time_s) const {
  constexpr int max_passes = 24;
  const int stride = (trace_.passes + max_passes - 1) / max_passes;
  const auto end = std::ranges::upper_bound(trace_.points, time_s, {}, &Trace::Point::time_s);
  if (end == trace_.points.begin()) return {};
  const int current = (end - 1)->pass;
  std::vector<Vector3d> nominal, actual;
  std::vector<std::array<int, 2>> segments;
  int previous_pass = -1;
  for (auto point = trace_.points.begin(); point != end; ++point) {
    if (point->pass != current && point->pass % std::max(1, stride) != stride / 2) continue;
    if (point->pass == previous_pass)
      segments.push_back({int(nominal.size()) - 1, int(nominal.size())});
    nominal.push_back(point->nominal_w);
    actual.push_back(point->actual_w);
    previous_pass = point->pass;
  }
  return {{point_matrix(nominal), segments, nominal_path, 1.5},
          {point_matrix(actual), segments, actual_path, 1.5}};
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
    state.vertex_styles = stock_styles_;
    return;
  }
  state.part = design_;
  state.vertex_styles.assign(std::size_t(design_->vertices.rows()), raw_style);
  if (source_.surface == nullptr) return;
  const auto& cut_times_s = source_.surface->cut_time_s;
  for (Eigen::Index i = 0; i < cut_times_s.size(); ++i)
    if (cut_times_s[i] <= time_s)
      state.vertex_styles[std::size_t(i)] = fresh_style;  // false for NaN: never cut
}

render::FilmState ProgramFilm::state(std::size_t frame) {
  const FrameSample& frame_sample = frame_samples_.at(frame);
  const double time_s = plan_.time_s[frame];
  render::FilmState state;
  state.T_bw = workpiece_in_bed(frame_sample);
  for (const Attachment& attachment : attachments_) {
    if (!attachment.segment)
      state.T_b.emplace_back(frame_sample.carriers_b[std::size_t(attachment.frame)] * attachment.T);
    else if (*attachment.segment == frame_sample.segment)
      state.T_b.emplace_back(state.T_bw * tool_pose(frame_sample));
    else
      state.T_b.emplace_back(std::nullopt);
  }
  const program::Samples& samples = part_commands(source_.commands, frame_sample.segment).samples;
  state.text = program_text_.line(segment_path(source_, frame_sample.segment)
                                      .blocks[std::size_t(samples.block[frame_sample.sample])]);
  state.values = values(frame_sample, time_s);
  if (!trace_.points.empty()) state.paths = paths(time_s);
  show_part(time_s, state);
  state.progress = end_s() > 0.0 ? time_s / end_s() : 1.0;
  return state;
}

}  // namespace abbe::sim

#endif
