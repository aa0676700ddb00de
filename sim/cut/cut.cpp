#include "sim/cut/cut.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/map/areal_filter.h"
#include "cutting/map/refinement.h"
#include "cutting/part/design_points.h"
#include "cutting/stock/stock.h"
#include "kinematics/pose.h"
#include "kinematics/units.h"
#include "sim/cut/collisions.h"
#include "sim/cut/judged_surface.h"
#include "sim/cut/process.h"
#include "sim/cut/process_simulation.h"
#include "sim/cut/sweep.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/tool_poses.h"
#include "sim/files/progress.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

// Errors of the tool pose over the samples of a program: tip in mm, direction in rad.
struct PoseErrors {
  Spread tip;
  Spread direction;
};

/// Returns an upper bound of the distance by which the actual tool extends beyond the nominal one,
/// mm.
double oversize(const ToolDescription& tool) {
  if (const auto* nominal = std::get_if<cutting::Cutter>(&tool.nominal)) {
    const auto& actual = std::get<cutting::Cutter>(tool.actual);
    if (nominal->outline && actual.outline)
      return cutting::max_separation(*nominal->outline, *actual.outline);
    return std::abs(actual.radius - nominal->radius) +
           std::abs(actual.corner_radius - nominal->corner_radius);
  }
  const auto& actual = std::get<cutting::Nose>(tool.actual);
  if (actual.profile)
    return cutting::max_separation(*actual.profile, *std::get<cutting::Nose>(tool.nominal).profile);
  double size = std::abs(actual.radius - std::get<cutting::Nose>(tool.nominal).radius);
  for (const cutting::NoseWave& wave : actual.waves) size += std::abs(wave.amplitude);
  return size;
}

/// Returns the largest distance of the edge of a turning tool from its centre, mm.
double edge_radius(const cutting::Nose& nose) {
  return nose.profile ? nose.profile->outer_radius : nose.radius;
}

/// Returns an upper bound, mm, of the gouge that the errors explain: displaced tip, tilt over the
/// length of the tool, larger tool.
double explained_gouge(const Segment& segment, const PoseErrors& errors) {
  const auto* cutter = std::get_if<cutting::Cutter>(&segment.scene.tool.actual);
  const double arm = cutter != nullptr
                         ? cutter->flank_length + cutter->radius
                         : edge_radius(std::get<cutting::Nose>(segment.scene.tool.actual));
  return errors.tip.max + errors.direction.max * arm + oversize(segment.scene.tool);
}

std::string gouge_text(const ProgramGouge& gouge, int flank_count) {
  return fmt::format(
      "the program moves the tool into the design by more than {} mm plus the errors at {} "
      "vertices, {} of them with the flank; the deepest gouge is {:.3f} mm (line {})",
      cutting::rubbing, gouge.vertices, flank_count, gouge.deepest, gouge.line);
}

/// A map with the error of its interpolation and its warnings.
struct CutMap {
  cutting::Surface surface;
  std::optional<cutting::InterpolationError> interpolation;
  std::vector<std::string> warnings;
};

/// Returns the resolution that a map must have, mm: that of the scene. Without one it is the
/// resolution for which the vertices were chosen, or the default fraction of the range of this map
/// if that is more, since errors may enlarge the range.
double target_resolution(const Job& job, const cutting::Surface& surface) {
  const double sampled = job.sampled->resolution;
  if (job.scene.part.sampling.resolution) return sampled;
  return std::max(sampled, cutting::default_resolution(trimmed_range(surface, job.design_w)));
}

/// Returns advice for a map that is too coarse for the texture. Its form is still usable if the
/// form filter averages enough values.
/// @param cutoff  wavelength that the filter passes by half, mm
std::string form_advice(const cutting::Design& design, double cutoff) {
  if (cutting::resolves_form(design, cutoff)) return "judge by form_um, or";
  const double values =
      cutting::effective_value_count(cutoff, double(design.triangles.rows()) / design.area.sum());
  return fmt::format(
      "form_um is no better, with {:.2g} values within its cut-off of {:.3g} mm (at least {:.3g} "
      "are needed);",
      values, cutoff, cutting::min_filter_values);
}

/// Returns the advice to set those keys of [part] that make the vertices denser.
std::string sampling_advice(const PartDescription& part) {
  switch (part.sampling.kind) {
    case PartSampling::Kind::Adaptive:
      return "raise part.points, or part.resolution_um";
    case PartSampling::Kind::Spacing:
      return "lower part.spacing_mm";
    case PartSampling::Kind::Vertices:
      break;
  }
  const bool is_mesh = std::holds_alternative<MeshFile>(part.shape);
  return std::string(is_mesh ? "" : "raise part.vertices, or ") +
         "set part.sampling to \"adaptive\"";
}

std::string unresolved_text(const cutting::InterpolationError& error, double resolution,
                            const Job& job) {
  return fmt::format(
      "the map is too coarse for the machined surface: between its {} vertices, linear "
      "interpolation is off by more than {:.3g} um on {:.3g} % of the surface and by up to {:.3g} "
      "um: {} {}",
      job.design_w.vertices.rows(), resolution / units::um, 100.0 * error.unresolved,
      error.worst / units::um, form_advice(job.design_w, job.scene.part.form_cutoff),
      sampling_advice(job.scene.part));
}

/// Calls `use` for each sweep of a program in order.
using SweepVisitor = std::function<void(const std::function<void(const ToolSweep&)>& use)>;

/// Returns the number of gouge vertices that flanks have cut. A vertex counts for the first sweep
/// that contains the time of its cut, since neighbouring sweeps may share a sample.
int total_flank_gouges(ProgramGouge gouge, const cutting::Surface& surface,
                       const cutting::Design& design_w, const SweepVisitor& visit_sweeps) {
  int count = 0;
  visit_sweeps([&](const ToolSweep& sweep) {
    const auto* cutter = std::get_if<cutting::Cutter>(&sweep.tool);
    const auto& states = sweep.samples.states;
    if (cutter == nullptr || states.empty()) return;
    const auto is_during = [&](Eigen::Index i) {
      const double time_s = surface.cut_time_s[i];
      return time_s >= states.front().time_s && time_s <= states.back().time_s;
    };
    ProgramGouge sweep_gouge = gouge;
    std::erase_if(sweep_gouge.at, [&](Eigen::Index i) { return !is_during(i); });
    std::erase_if(gouge.at, is_during);
    if (sweep_gouge.at.empty()) return;
    count += flank_gouge_count(sweep_gouge, surface, design_w, *cutter,
                               cutter_motion(sweep.T_wt, sweep.samples));
  });
  return count;
}

/// Inputs of a map. The gouge that the errors explain, mm, is a function, since a job in windows
/// knows it only after the surface is cut.
struct CutInputs {
  Sweep sweep;
  SweepVisitor visit_sweeps;
  const program::Path& path;
  std::function<double()> explained_gouge;
  std::shared_ptr<const cutting::Surface> known = {};  ///< the surface if it was cut before
};

SweepVisitor sweep_visitor(const std::vector<ToolSweep>& sweeps) {
  return [&](const auto& use) { std::ranges::for_each(sweeps, use); };
}

std::shared_ptr<const cutting::Surface> error_free_surface(const Job& job) {
  return job.sampled ? job.sampled->error_free : nullptr;
}

// Two moves that leave surfaces closer than this, mm, differ by rounding.
constexpr double same_depth = 1e-6;

/// Returns the moves in feed of a sweep, without the rapids between them.
std::vector<SweptWindow> feed_runs(const ToolSweep& sweep) {
  const program::Samples& samples = sweep.samples;
  std::vector<SweptWindow> runs;
  const auto add_sample = [&](std::size_t i) {
    SweptWindow& run = runs.back();
    run.samples.states.push_back(samples.states[i]);
    run.samples.line.push_back(samples.line[i]);
    run.samples.block.push_back(samples.block[i]);
    run.T_wt.push_back(sweep.T_wt[i]);
  };
  bool in_run = false;
  for (std::size_t i = 1; i < samples.states.size(); ++i) {
    const bool feeds = is_feed_sample(sweep.path, samples, i);
    if (feeds && !in_run) {
      runs.emplace_back();
      add_sample(i - 1);  // a feed begins where the move before it ends
    }
    if (feeds) add_sample(i);
    in_run = feeds;
  }
  return runs;
}

/// Returns a box around all points that a milling cutter removes near its path, mm; the whole space
/// for a turning tool, under which the part turns.
Eigen::AlignedBox3d swept_box(const std::variant<cutting::Cutter, cutting::Nose>& tool,
                              const std::vector<Pose>& T_wt, double band) {
  const auto* cutter = std::get_if<cutting::Cutter>(&tool);
  if (cutter == nullptr)
    return {Eigen::Vector3d::Constant(-infinity), Eigen::Vector3d::Constant(infinity)};
  const double height = cutting::support(*cutter, 1.0, 0.0);
  const double margin = cutting::support(*cutter, 0.0, 1.0) + band;
  Eigen::AlignedBox3d box;
  for (const Pose& T : T_wt) {
    box.extend(T.translation());
    box.extend(T.translation() + height * T.linear().col(2));
  }
  return {box.min().array() - margin, box.max().array() + margin};
}

/// Returns (vertices) the residual of a surface, mm, also where it is gouged; infinite where uncut.
Eigen::VectorXd all_residuals(const cutting::Surface& surface) {
  Eigen::VectorXd residual = Eigen::VectorXd::Constant(surface.residual.size(), infinity);
  for (Eigen::Index i = 0; i < residual.size(); ++i)
    if (surface.status[std::size_t(i)] == cutting::VertexStatus::Cut)
      residual[i] = surface.residual[i];
  for (const cutting::Gouge& gouge : surface.gouges) residual[gouge.vertex] = -gouge.depth;
  return residual;
}

/// Returns those of the vertices that no move in feed before their cut has reached as deep.
/// @param tolerance  mm
std::vector<Eigen::Index> not_fed_before(const Job& job, const cutting::Surface& surface,
                                         std::vector<Eigen::Index> vertices, double tolerance,
                                         const SweepVisitor& visit_sweeps) {
  const auto reached_by = [&](const SweptWindow& run, const ToolSweep& sweep) {
    const auto& states = run.samples.states;
    std::set<Eigen::Index> reached;
    std::vector<Eigen::Index> near_vertices;
    std::vector<cutting::Contact> contacts;
    const Eigen::AlignedBox3d box = swept_box(sweep.tool, run.T_wt, job.scene.band);
    for (const Eigen::Index i : vertices) {
      const Eigen::Vector3d point = job.design_w.vertices.row(i);
      const double cut_time_s = surface.cut_time_s[i];
      // The feeds and rapids of a cycle share a line.
      if (cut_time_s >= states.front().time_s && cut_time_s <= states.back().time_s)
        reached.insert(i);
      if (cut_time_s < states.back().time_s || !box.contains(point)) continue;
      near_vertices.push_back(i);
      contacts.push_back({point, job.design_w.normals.row(i)});
    }
    if (contacts.empty()) return reached;
    const Eigen::VectorXd residual = all_residuals(machined_surface(
        cutting::design_from_points(contacts),
        {{sweep.tool, run.samples, run.T_wt, sweep.chain, sweep.workpiece_spindle, sweep.path}},
        surface_options(job, {})));
    for (std::size_t k = 0; k < near_vertices.size(); ++k)
      if (residual[Eigen::Index(k)] <= surface.residual[near_vertices[k]] + tolerance)
        reached.insert(near_vertices[k]);
    return reached;
  };
  visit_sweeps([&](const ToolSweep& sweep) {
    for (const SweptWindow& run : feed_runs(sweep)) {
      stop_if_interrupted();
      if (vertices.empty()) return;
      const std::set<Eigen::Index> reached = reached_by(run, sweep);
      std::erase_if(vertices, [&](Eigen::Index i) { return reached.contains(i); });
    }
  });
  return vertices;
}

CutMap cut_map(const Job& job, const CutInputs& inputs) {
  const Sweep& sweep = inputs.sweep;
  CutMap map;
  // The error-free surface was cut when the vertices were chosen. A second cut would give the same
  // bits.
  map.surface = inputs.known ? *inputs.known : sweep.surface(job.design_w);
  const double explained = inputs.explained_gouge();  // in windows known after the surface
  const ProgramGouge gouge = program_gouge(map.surface, explained);
  if (gouge.vertices > 0)
    map.warnings.push_back(gouge_text(
        gouge, total_flank_gouges(gouge, map.surface, job.design_w, inputs.visit_sweeps)));
  // Errors move feed and rapid alike, apart from hysteresis and force.
  const double tolerance = same_depth + std::min(explained, cutting::rubbing);
  add_warnings(surface_warnings(map.surface, inputs.path, job.scene.band,
                                [&](std::vector<Eigen::Index> vertices) {
                                  return not_fed_before(job, map.surface, std::move(vertices),
                                                        tolerance, inputs.visit_sweeps);
                                }),
               map.warnings);
  if (job.sampled) {
    const double resolution = target_resolution(job, map.surface);
    const cutting::SurfaceInterpolator interpolator = surface_interpolator(job);
    map.surface = cutting::sample_within_triangles(
        std::move(map.surface), job.design_w, job.sampled->within, interpolator, sweep.surface);
    map.interpolation =
        cutting::interpolation_error(job.design_w, map.surface, interpolator, sweep.surface,
                                     {.seed = job.scene.seed, .resolution = resolution});
    if (map.interpolation->places == 0)
      map.warnings.push_back(
          "no point between the vertices could be sampled: the resolution of the map is unknown");
    if (map.interpolation->unresolved > max_unresolved_fraction)
      map.warnings.push_back(unresolved_text(*map.interpolation, resolution, job));
  }
  return map;
}

/// Returns RMS and maximum of the errors of the tool pose.
/// @param first  number of the first sample that counts
PoseErrors pose_errors(const std::vector<Pose>& T_wt, const std::vector<Pose>& T_wt_nominal,
                       std::size_t first) {
  PoseErrors errors;
  for (std::size_t i = first; i < T_wt.size(); ++i) {
    const double tip = (T_wt[i].translation() - T_wt_nominal[i].translation()).norm();
    const Eigen::Vector3d u = T_wt[i].linear().col(2), v = T_wt_nominal[i].linear().col(2);
    const double direction = kinematics::angle_between(u, v);
    errors.tip.rms += tip * tip;
    errors.tip.max = std::max(errors.tip.max, tip);
    errors.direction.rms += direction * direction;
    errors.direction.max = std::max(errors.direction.max, direction);
  }
  const double n = std::max(1.0, double(T_wt.size()) - double(first));
  errors.tip.rms = std::sqrt(errors.tip.rms / n);
  errors.direction.rms = std::sqrt(errors.direction.rms / n);
  return errors;
}

/// Simulates stock and forces of a part of a case with its actual poses.
/// @param before  has the stock that the parts before have left
Process simulated_process(const ActualRun& run, const Progress& progress, Process before) {
  const Segment& segment = run.segment;
  if (!segment.scene.cutting) return {};
  const auto pose = [&](std::size_t sample, const errors::Load& load) {
    return actual_pose(run, sample, load);
  };
  return simulate_process(
      segment.scene, segment.machine, *segment.body_m,
      {run.commands.samples, path_of(segment, run.commands), run.T_wt_target, pose,
       segment.truth.actual, segment.scene.tool.actual},
      [&](double fraction) {
        if (progress) progress("stock", fraction);
      },
      std::move(before));
}

/// Returns the name of the geometric element with the largest value at an axis state. Angles count
/// at a lever of 1 m.
std::string largest_element(const Segment& segment, const AxisState& state) {
  constexpr double lever = 1000.0;  // mm
  std::string name = "not from [errors] but from heat, force, clamping or tool";
  double max_value = 0.0;
  const auto& joints = segment.machine.nominal.joints();
  for (const errors::Element& element : segment.scene.geometric.elements) {
    const auto joint = std::ranges::find_if(joints, [&](const kinematics::Joint& candidate) {
      return candidate.name == element.name.axis ||
             (candidate.name == 's' && element.name.axis == 'S');
    });
    if (joint == joints.end()) continue;
    const auto j = std::size_t(joint - joints.begin());
    errors::CurveState curve_state;
    curve_state.command = state.q[Eigen::Index(j)];
    curve_state.primed = joint->side == kinematics::Side::Workpiece;
    curve_state.carriage = curve_state.primed ? -curve_state.command : curve_state.command;
    curve_state.direction = state.direction[j];
    curve_state.stroke = state.stroke[j];
    double value = 0.0;
    for (const errors::Curve& curve : element.curves) value += errors::value(curve, curve_state);
    value *= std::abs(segment.scene.error_scale) * (element.name.is_angle() ? lever : 1.0);
    if (!(std::abs(value) > max_value)) continue;
    max_value = std::abs(value);
    name = "errors." + errors::to_string(element.name);
  }
  return name;
}

/// Throws BadInput if the tip deviates by more than 1 m. No machine has such errors, so a unit or
/// errors.scale must be wrong. The message names the largest element.
void check_tips(const ActualRun& run, const std::vector<Pose>& T_wt) {
  constexpr double max_mm = 1000.0;
  const program::Samples& samples = run.commands.samples;
  for (std::size_t i = 0; i < T_wt.size(); ++i) {
    const double deviation = (T_wt[i].translation() - run.T_wt_target[i].translation()).norm();
    if (deviation <= max_mm) continue;
    const program::Path& path = path_of(run.segment, run.commands);
    throw BadInput(
        path.file, samples.line[i], 0,
        fmt::format("errors (times errors.scale) that move the tip by at most {} mm", max_mm),
        fmt::format("{:.3g} mm in this block, largest contribution: {}", deviation,
                    largest_element(run.segment, samples.states[i])));
  }
}

/// Returns (samples) the stroke of the piezo, mm; empty without one.
std::span<const double> piezo_stroke(const Commands& commands) {
  if (!commands.piezo) return {};
  return {commands.piezo->stroke.data(), std::size_t(commands.piezo->stroke.size())};
}

/// Returns the spread over the samples of both.
/// @param n_a, n_b  number of samples of each
Spread joined(const Spread& a, double n_a, const Spread& b, double n_b) {
  if (!(n_a > 0.0)) return b;
  const double samples = n_a + n_b;
  return {std::sqrt((n_a * a.rms * a.rms + n_b * b.rms * b.rms) / samples), std::max(a.max, b.max)};
}

PoseErrors joined(const PoseErrors& a, double n_a, const PoseErrors& b, double n_b) {
  return {joined(a.tip, n_a, b.tip, n_b), joined(a.direction, n_a, b.direction, n_b)};
}

/// Errors of the tool poses of a run, of each tool and of all.
class RunErrors {
 public:
  explicit RunErrors(const Job& job) : job_(job), tools_(tool_segments(job).size()) {}

  /// Adds a segment, or a window of it.
  /// @param tool           index in `tool_segments`
  /// @param max_intervals  number of intervals sampled for the chord error, at most
  void add(std::size_t tool, const ActualRun& run, const std::vector<Pose>& T_wt,
           std::size_t max_intervals);
  /// Returns an upper bound, mm, of the gouge that they explain.
  double explained_gouge() const;
  void write_to(Cut& result) const;

 private:
  struct Errors {
    PoseErrors pose;
    double samples = 0.0;
    void add(const PoseErrors& other, double count) {
      pose = joined(pose, samples, other, count);
      samples += count;
    }
  };
  const Job& job_;
  std::vector<Errors> tools_;
  Errors all_;
  ChordError chord_error_;
};

void RunErrors::add(std::size_t tool, const ActualRun& run, const std::vector<Pose>& T_wt,
                    std::size_t max_intervals) {
  // The first sample of a window that continues another is the last of that one, and counts once.
  const std::size_t first = run.segment.sampling.continued_from ? 1 : 0;
  const PoseErrors errors = pose_errors(T_wt, run.T_wt_target, first);
  const double samples = double(T_wt.size()) - double(first);
  tools_[tool].add(errors, samples);
  all_.add(errors, samples);
  chord_error_ = joined(chord_error_, check_table_range(run.segment, [&] {
                          return chord_error(run.segment, run.commands, max_intervals);
                        }));
}

double RunErrors::explained_gouge() const {
  double max_explained = 0.0;
  for (std::size_t i = 0; i < tools_.size(); ++i)
    max_explained =
        std::max(max_explained, sim::explained_gouge(tool_segments(job_)[i], tools_[i].pose));
  return max_explained;
}

void RunErrors::write_to(Cut& result) const {
  result.tip_error = all_.pose.tip;
  result.direction_error = all_.pose.direction;
  result.chord_error = chord_error_;
  add_warnings(chord_error_warnings(chord_error_, all_.pose.tip.rms), result.warnings);
}

/// Appends the process of a tool to the result, with its warnings.
void add_process(const Job& job, std::size_t tool, Process process, Cut& result) {
  const Scene& scene = tool_segments(job)[tool].scene;
  const std::string prefix =
      job.segments.size() > 1 ? fmt::format("T{}: ", *scene.tool.number) : "";
  for (const std::string& warning : process_warnings(scene, process))
    result.warnings.push_back(prefix + warning);
  append_part(std::move(process), result.process);
}

/// Returns the actual poses of a run.
std::vector<Pose> checked_poses(const ActualRun& run, const std::vector<errors::Load>& loads) {
  return check_table_range(run.segment, [&] {
    std::vector<Pose> T_wt = actual_poses(run, loads, {});
    check_tips(run, T_wt);
    return T_wt;
  });
}

/// The motion of a segment on the machine with errors.
struct SegmentMotion {
  std::vector<Pose> T_wt;
  std::deque<WornSegment> worn_cutter;  ///< swept instead of T_wt if the radius of the tool wears
};

/// Computes the actual poses of a segment, and adds its process, signals and errors.
SegmentMotion segment_motion(const Job& job, std::size_t number, const Commands& commands,
                             const Progress& progress, RunErrors& run_errors, Cut& result) {
  Stopwatch watch;
  const Segment& segment = job_segments(job)[number];
  const ActualRun run = actual_run(segment, commands);
  Process process = check_table_range(
      segment, [&] { return simulated_process(run, progress, take_stock(result.process)); });
  result.timing_s["stock"] += watch.lap();
  if (progress) progress("poses", 0.0);
  const std::vector<errors::Load> loads = sample_loads(run, process);
  result.signals = joined(std::move(result.signals), check_table_range(segment, [&] {
                            return signals(segment.scene, segment.machine, segment.truth,
                                           {commands.samples, run.T_wt_target, process, loads,
                                            commands.correction, piezo_stroke(commands)});
                          }));
  SegmentMotion motion{checked_poses(run, loads), {}};
  add_process(job, number, std::move(process), result);
  run_errors.add(number, run, motion.T_wt, default_interval_count);
  if (!run.wear.empty() && segment.scene.tool.wear->radius > 0.0)
    motion.worn_cutter = worn_segments(segment.scene.tool, run.wear, commands.samples, motion.T_wt);
  result.timing_s["poses"] += watch.lap();
  return motion;
}

/// Adds the sweep of a segment, or the sweeps of its parts if the radius of the tool wears. The
/// sweeps refer to the arguments.
void add_sweeps(const Segment& segment, const Commands& commands, const SegmentMotion& motion,
                std::vector<ToolSweep>& sweeps) {
  const auto& chain = segment.truth.actual;
  const std::optional<int> spindle = segment.machine.workpiece_spindle;
  const program::Path& path = path_of(segment, commands);
  for (const WornSegment& worn : motion.worn_cutter)
    sweeps.push_back({worn.tool, worn.samples, worn.T_wt, chain, spindle, path});
  if (motion.worn_cutter.empty())
    sweeps.push_back(
        {segment.scene.tool.actual, commands.samples, motion.T_wt, chain, spindle, path});
}

}  // namespace

Cut cut_error_free(const Job& job, const Progress& progress, Retention keep) {
  Stopwatch watch;
  Cut result;
  result.name = result.case_name = "error_free";
  if (progress) progress("surface", 0.0);  // shown while the moves are sorted
  const SweepVisitor visit_sweeps = [&](const std::function<void(const ToolSweep&)>& use) {
    visit_segments(job, [&](const Segment& segment) { use(segment_error_free_sweep(segment)); });
  };
  CutMap map = cut_map(job, {error_free_sweep(job, surface_options(job, progress)), visit_sweeps,
                             job.path, [] { return 0.0; }, error_free_surface(job)});
  result.surface = std::move(map.surface);
  result.interpolation = map.interpolation;
  result.process = job.nominal_process;
  if (keep == Retention::Track) {
    std::vector<TrackedSegment> parts;
    for (const Segment& segment : job_segments(job))
      parts.push_back({segment.samples, segment.T_wt_nominal, segment.T_wt_nominal});
    result.track = join_tracks(parts);
  }
  add_warnings(process_warnings(job.scene, result.process), result.warnings);
  add_warnings(std::move(map.warnings), result.warnings);
  result.timing_s["surface"] = watch.lap();
  return result;
}

void check_travel(const Job& job, const Commands& commands) {
  const auto parts = job_segments(job);
  for (std::size_t i = 0; i < parts.size(); ++i)
    check_travel(parts[i].machine, path_of(parts[i], part_commands(commands, i)),
                 part_commands(commands, i).samples);
}

Process segment_process(const Segment& segment, const Commands& commands, Process before,
                        const Progress& progress) {
  return simulated_process(actual_run(segment, commands), progress, std::move(before));
}

Process cut_process(const Job& job, const Commands& commands, const Progress& progress) {
  Process process;
  const auto segments = job_segments(job);
  for (std::size_t i = 0; i < segments.size(); ++i)
    append_part(
        segment_process(segments[i], part_commands(commands, i), take_stock(process), progress),
        process);
  return process;
}

namespace {

std::string not_converged_text(std::size_t corrections, std::size_t total) {
  return fmt::format("{} of {} corrections did not converge", corrections, total);
}

/// Throws CollisionStop if the program cannot run. The message lists the collisions, since no
/// result file is written.
void stop_at_collision(const Collisions& collisions) {
  if (is_clear(collisions)) return;
  std::string text = "stopped before cutting (collision.stop)";
  for (const std::string& warning : collision_warnings(collisions)) text += "; " + warning;
  throw CollisionStop(text + "; for positions and clearances run abbe check SCENE --collisions");
}

/// Adds the collisions to a cut, if the scene requests them.
/// @throws CollisionStop if the scene asks to stop at a collision and there is one
void add_collisions(const Job& job, const std::function<Collisions()>& search, Cut& result) {
  if (!job.scene.collision.is_enabled) return;
  result.collisions = search();
  result.timing_s["collisions"] = result.collisions->seconds;
  if (job.scene.collision.stop) stop_at_collision(*result.collisions);
  add_warnings(collision_warnings(*result.collisions), result.warnings);
}

}  // namespace

Cut cut(const Job& job, const Commands& commands, const Progress& progress, Retention keep) {
  Cut result;
  result.name = result.case_name = "uncompensated";
  result.remaining_point_error = commands.remaining_point_error;
  result.remaining_direction_error = commands.remaining_direction_error;
  result.rewritten_program = commands.rewritten_program;
  result.warnings = commands.warnings;
  if (commands.not_converged > 0)
    result.warnings.push_back(
        not_converged_text(commands.not_converged, job.samples.states.size()));
  // The travel is checked first, since collisions, poses and surface take most of the time.
  check_travel(job, commands);
  add_collisions(
      job, [&] { return collisions(job, commands, result.name, progress); }, result);
  const auto segments = job_segments(job);
  std::vector<SegmentMotion> motions;
  RunErrors run_errors(job);
  for (std::size_t i = 0; i < segments.size(); ++i)
    motions.push_back(
        segment_motion(job, i, part_commands(commands, i), progress, run_errors, result));
  run_errors.write_to(result);
  add_warnings(idle_warnings(job.scene), result.warnings);
  if (keep == Retention::Track) {
    std::vector<TrackedSegment> tracked;
    for (std::size_t i = 0; i < segments.size(); ++i)
      tracked.push_back({part_commands(commands, i).samples,
                         target_poses(segments[i], part_commands(commands, i)), motions[i].T_wt});
    result.track = join_tracks(tracked);
  }
  Stopwatch watch;
  if (progress) progress("surface", 0.0);  // shown while the moves are sorted
  std::vector<ToolSweep> sweeps;
  for (std::size_t i = 0; i < segments.size(); ++i)
    add_sweeps(segments[i], part_commands(commands, i), motions[i], sweeps);
  result.wear = worn_tools(tool_runs(job));
  CutMap map =
      cut_map(job, {make_sweep(sweeps, surface_options(job, progress)), sweep_visitor(sweeps),
                    path_of(job, commands), [&] { return run_errors.explained_gouge(); }});
  result.surface = std::move(map.surface);
  result.interpolation = map.interpolation;
  add_warnings(std::move(map.warnings), result.warnings);
  result.timing_s["surface"] = watch.lap();
  return result;
}

namespace {

/// Returns the commands of a window, whose axes stay within their travel.
Commands checked_commands(const Segment& window, std::size_t number,
                          const CommandSource& command_source) {
  Commands commands = command_source(window, number);
  check_travel(window.machine, path_of(window, commands), commands.samples);
  return commands;
}

}  // namespace

Process segment_process(const Job& job, std::size_t segment, const CommandSource& command_source,
                        Process before, const Progress& progress) {
  const Segment& tool = tool_segments(job)[segment];
  const auto commands = [&](const Segment& window, std::size_t number) {
    return checked_commands(window, number, command_source);
  };
  const auto pose = [&](const AxisState& state, const Pose&, const errors::Load& load) {
    return tool_in_workpiece(tool.truth, state, load);
  };
  return check_table_range(tool, [&] {
    return windowed_process(job, segment, commands, pose, tool.truth.actual, tool.scene.tool.actual,
                            std::move(before), progress);
  });
}

namespace {

/// The process and the rows of signals of one tool of a job in windows.
struct WindowedRun {
  Process process = {};                              // without the stock
  std::optional<SignalSamples> signal_samples = {};  // empty without signals
  std::optional<SignalRow> start = {};
  std::vector<SignalRow> rows = {};
};

/// Runs the windows of a job on the machine with errors, and adds the figures of each window to the
/// cut when the window first runs.
class WindowedCut {
 public:
  WindowedCut(const Job& job, const WindowedProgram& program, const Progress& progress,
              Cut& result);

  SweptWindow at(std::size_t number);
  void visit_sweeps(const std::function<void(const ToolSweep&)>& use);
  double explained_gouge() const { return run_errors_.explained_gouge(); }
  /// Adds the figures that are known after all windows have run.
  void finish();

 private:
  void report(std::size_t number, const ActualRun& run, const std::vector<errors::Load>& loads,
              const std::vector<Pose>& T_wt);
  void pick_signals(std::size_t number, const ActualRun& run,
                    const std::vector<errors::Load>& loads);

  const Job& job_;
  const WindowedProgram& program_;
  Cut& result_;
  std::vector<WindowRange> ranges_;  // by tool
  std::vector<WindowedRun> tools_;
  RunErrors run_errors_;
  std::size_t reported_ = 0;  // number of windows
  std::size_t not_converged_ = 0;
  std::vector<std::string> command_warnings_;
};

WindowedCut::WindowedCut(const Job& job, const WindowedProgram& program, const Progress& progress,
                         Cut& result)
    : job_(job),
      program_(program),
      result_(result),
      ranges_(window_ranges(job)),
      tools_(ranges_.size()),
      run_errors_(job) {
  for (std::size_t i = 0; i < ranges_.size(); ++i) {
    if (has_signals(job.scene, false) && ranges_[i].first < ranges_[i].last)
      tools_[i].signal_samples.emplace(job.scene.signals.interval,
                                       program.windows[ranges_[i].first].start_s,
                                       program.windows[ranges_[i].last - 1].end_s);
    if (!job.scene.cutting) continue;
    // The process of the whole program comes first: a sample between two steps, whose load lies
    // between theirs, may be in another window than the second.
    add_process(job, i,
                segment_process(job, i, program.commands, take_stock(result.process), progress),
                result);
    tools_[i].process = part_process(result.process, i);
  }
}

SweptWindow WindowedCut::at(std::size_t number) {
  const std::size_t tool = job_.windows->all[number].segment;
  const Segment window = make_window(job_, number);
  Commands commands = checked_commands(window, number, program_.commands);
  const ActualRun run = actual_run(window, commands);
  const std::vector<errors::Load> loads = sample_loads(run, tools_[tool].process);
  std::vector<Pose> T_wt = checked_poses(run, loads);
  // The first sweep takes the windows in order. Later ones repeat windows that were reported.
  if (number == reported_) report(number, run, loads, T_wt);
  return {std::move(commands.samples), std::move(T_wt),
          commands.path ? *std::move(commands.path) : window.path};
}

void WindowedCut::visit_sweeps(const std::function<void(const ToolSweep&)>& use) {
  for (std::size_t i = 0; i < job_.windows->all.size(); ++i) {
    const SweptWindow swept = at(i);
    const Segment& tool = tool_segments(job_)[job_.windows->all[i].segment];
    use({tool.scene.tool.actual, swept.samples, swept.T_wt, tool.truth.actual, std::nullopt,
         swept.path});
  }
}

void WindowedCut::report(std::size_t number, const ActualRun& run,
                         const std::vector<errors::Load>& loads, const std::vector<Pose>& T_wt) {
  ++reported_;
  const Commands& commands = run.commands;
  // At least 10 intervals of each window, since the quotient is zero beyond 1000 windows.
  run_errors_.add(job_.windows->all[number].segment, run, T_wt,
                  std::max(std::size_t(10), default_interval_count / job_.windows->all.size()));
  pick_signals(number, run, loads);
  result_.remaining_point_error =
      std::max(result_.remaining_point_error, commands.remaining_point_error);
  result_.remaining_direction_error =
      std::max(result_.remaining_direction_error, commands.remaining_direction_error);
  not_converged_ += commands.not_converged;
  for (const std::string& warning : commands.warnings)
    if (std::ranges::find(command_warnings_, warning) == command_warnings_.end())
      command_warnings_.push_back(warning);
}

void WindowedCut::pick_signals(std::size_t number, const ActualRun& run,
                               const std::vector<errors::Load>& loads) {
  const std::size_t segment = job_.windows->all[number].segment;
  WindowedRun& tool = tools_[segment];
  if (!tool.signal_samples) return;
  const program::Samples& samples = run.commands.samples;
  const auto row = [&](std::size_t i) {
    return SignalRow{samples.states[i], samples.line[i], loads.empty() ? errors::Load{} : loads[i],
                     run.T_wt_target[i], i};
  };
  if (!tool.start) tool.start = SignalRow{samples.states[0], 0, {}, run.T_wt_target[0], 0};
  tool.signal_samples->pick(samples.states, number > ranges_[segment].first,
                            number + 1 < ranges_[segment].last,
                            [&](std::size_t i) { tool.rows.push_back(row(i)); });
}

void WindowedCut::finish() {
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    const Segment& segment = tool_segments(job_)[i];
    if (tools_[i].start)
      result_.signals =
          joined(std::move(result_.signals),
                 signals(segment.scene, segment.machine, segment.truth, *tools_[i].start,
                         std::move(tools_[i].rows), tools_[i].process));
  }
  if (not_converged_ > 0)
    command_warnings_.push_back(not_converged_text(not_converged_, job_.windows->samples));
  // As in a run of the whole, those of the commands precede those of the process.
  result_.warnings.insert(result_.warnings.begin(), command_warnings_.begin(),
                          command_warnings_.end());
  run_errors_.write_to(result_);
}

}  // namespace

Cut cut_in_windows(const Job& job, const WindowedProgram& program, const Progress& progress) {
  Stopwatch watch;
  Cut result;
  result.name = result.case_name = "uncompensated";
  add_collisions(
      job, [&] { return collisions(job, program, result.name, progress); }, result);
  WindowedCut run(job, program, progress, result);
  if (job.scene.cutting) result.timing_s["stock"] = watch.lap();
  if (progress) progress("surface", 0.0);
  const auto window = [&run](std::size_t number) { return run.at(number); };
  const Sweep sweep = sweep_in_windows(windowed_tools(job, &ToolDescription::actual), window,
                                       surface_options(job, progress));
  CutMap map = cut_map(job, {sweep, [&run](const auto& use) { run.visit_sweeps(use); },
                             program.path, [&run] { return run.explained_gouge(); }});
  result.surface = std::move(map.surface);
  result.interpolation = map.interpolation;
  run.finish();
  add_warnings(idle_warnings(job.scene), result.warnings);
  add_warnings(std::move(map.warnings), result.warnings);
  result.timing_s["surface"] = watch.lap();
  return result;
}

Cut cut(const Job& job, const Progress& progress, Retention keep) {
  if (job.windows)
    return cut_in_windows(
        job,
        {[](const Segment& window, std::size_t) { return segment_commands(window); }, job.path,
         job.windows->all},
        progress);
  Stopwatch watch;
  const Commands commands = uncompensated_commands(job);
  const double correction_s = watch.lap();
  Cut result = cut(job, commands, progress, keep);
  result.timing_s["correction"] = correction_s;
  return result;
}

std::vector<std::string> warnings_of(const Job& job, const Cut& cut) {
  std::vector<std::string> warnings = job.warnings;
  warnings.insert(warnings.end(), cut.warnings.begin(), cut.warnings.end());
  return warnings;
}

}  // namespace abbe::sim
