#include "sim/cut/placement_suggestion.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "kinematics/decompositions.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/cut/tool_motion.h"

namespace abbe::sim {

namespace {

using Eigen::Index;
using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Pose;

bool overlaps(const Span& a, const Span& b) { return a.low <= b.high && b.low <= a.high; }

/// Returns the motion of a milling cutter in feed only. Between two feeds the cutter retracts to
/// 10 m above the part, where it meets nothing, and its axis turns upwards.
cutting::CutterMotion feed_motion(const Segment& segment) {
  constexpr double clearance_height = 1e4;  // mm
  const cutting::CutterMotion motion = cutter_motion(segment.T_wt_nominal, segment.samples);
  const Eigen::Matrix3d R_wm = segment.scene.part.T_wm.linear();
  std::vector<Vector3d> tip, axis;
  std::vector<Index> sample_numbers;
  const auto add = [&](Index i) {
    tip.push_back(motion.tip.row(i));
    axis.push_back(motion.axis.row(i));
    sample_numbers.push_back(i);
  };
  const auto add_far_above = [&](Index i) {
    add(i);
    tip.back() += clearance_height * R_wm.col(2);
    // An axis that points down turns sideways, since the great circle to its opposite is not
    // defined.
    axis.back() = (axis.back() + R_wm.col(2)).norm() > 0.1 ? R_wm.col(2) : R_wm.col(0);
  };
  for (Index i = 1; i < motion.tip.rows(); ++i) {
    if (!is_feed_sample(segment.path, segment.samples, std::size_t(i))) continue;
    if (sample_numbers.empty() || sample_numbers.back() != i - 1) {
      if (!sample_numbers.empty()) add_far_above(sample_numbers.back());
      if (!sample_numbers.empty()) add_far_above(i - 1);
      add(i - 1);
    }
    add(i);
  }
  cutting::CutterMotion feed;
  const Index n = Index(sample_numbers.size());
  feed.tip.resize(n, 3);
  feed.axis.resize(n, 3);
  feed.time_s.resize(n);
  for (Index k = 0; k < n; ++k) {
    feed.tip.row(k) = tip[std::size_t(k)];
    feed.axis.row(k) = axis[std::size_t(k)];
    feed.time_s[k] = motion.time_s[sample_numbers[std::size_t(k)]];
    feed.line.push_back(motion.line[std::size_t(sample_numbers[std::size_t(k)])]);
  }
  return feed;
}

/// Returns the height of the feed above the part, mm: the minimum over the judged vertices along
/// the z axis of the part, negative if the feed lies below. None if no vertex has the feed above or
/// below it.
/// @param shift_w      displacement of the part, mm
/// @param search_band  largest height sought, mm
std::optional<double> feed_height(const Job& job, const cutting::Design& thinned_w,
                                  const Vector3d& shift_w, double search_band) {
  const bool has_feed =
      std::any_of(job.path.blocks.begin(), job.path.blocks.end(), program::is_feed);
  cutting::Design rays = thinned_w;
  rays.triangles.resize(0, 3);
  rays.vertices.rowwise() += shift_w.transpose();
  rays.normals.rowwise() = job.scene.part.T_wm.linear().col(2).transpose();
  std::optional<double> height;
  for (const Segment& part : job_segments(job)) {
    const cutting::CutterMotion motion =
        has_feed ? feed_motion(part) : cutter_motion(part.T_wt_nominal, part.samples);
    if (motion.tip.rows() == 0) continue;
    const cutting::Surface surface =
        cutting::milled_surface(rays, std::get<cutting::Cutter>(part.scene.tool.nominal), motion,
                                {.band = search_band, .progress = {}});
    for (Index i = 0; i < surface.residual.size(); ++i)
      if (surface.status[std::size_t(i)] == cutting::VertexStatus::Cut)
        height = std::min(height.value_or(infinity), surface.residual[i]);
  }
  return height;
}

/// Returns the shift of a milling program to the first contact with its part, mm, workpiece frame.
Vector3d milled_shift(const Job& job, const cutting::Design& thinned_w) {
  const SweptSpans swept = swept_spans(job);
  const Spans part = part_spans(job);
  Vector3d shift_m = Vector3d::Zero();
  // Coordinates that overlap stay: a program displaced from the part in x needs no other y.
  for (std::size_t k = 0; k < 2; ++k)
    if (!overlaps(part[k], swept.feed[k]))
      shift_m[Index(k)] = part[k].middle() - swept.tip[k].middle();
  const Eigen::Matrix3d R_wm = job.scene.part.T_wm.linear();
  // The search along z reaches from the top of the sweep to the bottom of the part, and vice versa.
  const double search_band = std::max(std::abs(swept.all[2].high - part[2].low),
                                      std::abs(part[2].high - swept.all[2].low)) +
                             job.scene.band;
  const auto height = feed_height(job, thinned_w, -(R_wm * shift_m), search_band);
  if (height)
    shift_m.z() = -*height;
  else if (!overlaps(part[2], swept.feed[2]))
    shift_m.z() = part[2].high - swept.feed[2].low;
  return R_wm * shift_m;
}

/// Returns the number of the first sample in feed; 0 if there is none.
std::size_t first_feed_sample(const Job& job) {
  for (std::size_t i = 0; i < job.samples.block.size(); ++i)
    if (is_feed_sample(job.path, job.samples, i)) return i;
  return 0;
}

/// Returns the shift of a turning program to the first contact with its part, mm: along the spindle
/// and radially.
Vector3d turned_shift(const Job& job) {
  const SweptSpans swept = swept_spans(job);
  const Spans part = part_spans(job);
  Vector3d shift = Vector3d::Zero();
  if (!overlaps(part[0], swept.feed[0])) shift[0] = part[0].middle() - swept.tip[0].middle();
  if (!overlaps(part[1], swept.feed[1]))
    shift[1] = swept.feed[1].low > part[1].high ? part[1].high - swept.feed[1].low
                                                : part[1].low - swept.feed[1].high;
  return shift;
}

/// The displacement of a program by a change of offsets, stated by three coordinates, mm: of a
/// milled part x y z of the workpiece; of a turned part, which spins, the displacements along the
/// spindle and radially in the bed frame, and zero.
class Displacement {
 public:
  explicit Displacement(const Job& job)
      : is_turned_(!std::holds_alternative<cutting::Cutter>(job.scene.tool.nominal)) {
    if (!is_turned_) return;
    line_ = spindle_line(job.machine.nominal, *job.machine.workpiece_spindle);
    const std::size_t first = first_feed_sample(job);
    const Vector3d radial_w = line_.radial(job.T_wt_nominal[first].translation());
    // A tool that begins on the spindle axis has no radial direction, so that it moves along the
    // spindle only. 1 nm is above the rounding of a pose.
    if (radial_w.norm() > 1e-6)
      radial_b_ = bed_in_workpiece(job, first).transpose() * radial_w.normalized();
  }

  bool is_turned() const { return is_turned_; }
  /// Returns the directions in which a search may step, in columns.
  Eigen::Matrix3d steps(const Job& job) const {
    if (!is_turned_) return job.scene.part.T_wm.linear();
    return Vector3d(1.0, radial_b_.norm(), 0.0).asDiagonal();
  }
  /// Returns the displacement of the tool at a sample of a part of the job, mm, workpiece frame.
  Vector3d at(const Segment& part, std::size_t sample, const Vector3d& d) const {
    if (!is_turned_) return d;
    return d[0] * line_.direction_w + d[1] * (bed_in_workpiece(part, sample) * radial_b_);
  }
  /// Returns the derivatives of a residual by the three coordinates.
  /// @param p_w, n_w  vertex and its normal
  Vector3d gradient(const Vector3d& p_w, const Vector3d& n_w) const {
    if (!is_turned_) return n_w;
    const Vector3d radial_w = line_.radial(p_w);
    const double radial = radial_w.norm() > 1e-9 ? n_w.dot(radial_w.normalized()) : 0.0;
    return {n_w.dot(line_.direction_w), radial * radial_b_.norm(), 0.0};
  }

 private:
  static Eigen::Matrix3d bed_in_workpiece(const Segment& part, std::size_t sample) {
    return part.machine.nominal.workpiece_in_bed(part.samples.states[sample].q)
        .linear()
        .transpose();
  }
  bool is_turned_;
  SpindleLine line_{Vector3d::Zero(), Vector3d::UnitZ()};
  Vector3d radial_b_ = Vector3d::Zero();
};

// Rounds to 1 um; adding zero removes the sign of -0.
double round_to_um(double mm) { return std::round(mm * 1e3) / 1e3 + 0.0; }

/// Returns the change of the programmed axis positions for a shift of the tip; none if the slides
/// cannot make it.
std::optional<AxisVector> programmed_change(const Job& job, std::size_t sample,
                                            const Vector3d& shift_w) {
  const kinematics::Chain& chain = job.machine.nominal;
  AxisVector change_q = AxisVector::Zero(chain.size());
  const program::Block& block = job.path.blocks[std::size_t(job.samples.block[sample])];
  if (block.coordinates == program::Coordinates::Tip) {
    for (const char name : {'X', 'Y', 'Z'}) change_q[*chain.find(name)] = shift_w[name - 'X'];
  } else {
    const Eigen::MatrixXd J_slides = slide_jacobian(chain, job.samples.states[sample].q);
    change_q = shortest_least_squares(J_slides, shift_w);
    // A machine that lacks one of the three slides leaves far more than this remainder.
    if ((J_slides * change_q - shift_w).norm() > 1e-6 * shift_w.norm()) return std::nullopt;
  }
  for (int j = 0; j < change_q.size(); ++j) change_q[j] = round_to_um(change_q[j]);
  return change_q;
}

/// A scene with changed work offsets, and a text such as "G54 Z = -80 (now -30)".
struct ShiftedScene {
  Scene scene;
  std::string offsets_text;
};

// Returns the scene with work offsets changed by a displacement; none if no offset of the scene
// moves the program.
std::optional<ShiftedScene> shift_offsets(const Job& job, const Displacement& displacement,
                                          const Vector3d& shift) {
  if (!std::holds_alternative<ProgramDescription::File>(job.scene.program.source))
    return std::nullopt;
  ShiftedScene shifted{job.scene, ""};
  const program::NcOptions control = nc_options(job.scene, job.machine);
  // A stated offset counts from another point than an omitted one; the difference is subtracted
  // below.
  const auto zero =
      program::program_zero(control) ? std::nullopt : program::workpiece_zero(control);
  std::set<int> visited;
  for (std::size_t i = 0; i < job.samples.block.size(); ++i) {
    const program::Block& block = job.path.blocks[std::size_t(job.samples.block[i])];
    const int offset_number = block.work_offset;
    if (!is_feed_sample(job.path, job.samples, i) || !visited.insert(offset_number).second)
      continue;
    if (offset_number < 0 || std::size_t(offset_number) >= job.scene.program.work_offset.size() ||
        job.scene.program.offsets)
      return std::nullopt;  // the offset is not set by `work_offset` of the scene
    const auto change = programmed_change(job, i, displacement.at(job, i, shift));
    if (!change) return std::nullopt;
    AxisVector& offset = shifted.scene.program.work_offset[std::size_t(offset_number)];
    if (offset.size() == 0) offset = AxisVector::Zero(change->size());
    const Vector3d correction = program::offset_correction(zero, block.coordinates);
    std::string axes_text;
    for (int j = 0; j < change->size(); ++j) {
      const double present = offset[j];
      const char name = job.machine.nominal.joints()[std::size_t(j)].name;
      offset[j] += (*change)[j];
      if (name >= 'X' && name <= 'Z') offset[j] -= correction[name - 'X'];
      if (offset[j] == present) continue;
      axes_text += fmt::format(" {} = {:.6g}", name, round_to_um(offset[j]));
      if (present != 0.0) axes_text += fmt::format(" (now {:.6g})", present);
    }
    shifted.offsets_text += fmt::format("{}G{}{}", shifted.offsets_text.empty() ? "" : ", ",
                                        54 + offset_number, axes_text);
  }
  if (shifted.offsets_text.empty()) return std::nullopt;
  return shifted;
}

/// Prepares a scene without errors, with its program read again. Returns none if the axes cannot
/// run the program.
std::optional<Job> error_free_job(Scene scene) {
  scene.geometric = {};
  scene.thermal.reset();
  scene.compliance.reset();
  scene.vibrations.clear();
  scene.cutting.reset();
  try {
    return prepare(scene);
  } catch (const BadInput&) {
    return std::nullopt;
  }
}

}  // namespace

ReachableArea reachable_area(const cutting::Design& design_w, const Job& job) {
  using cutting::VertexStatus;
  const cutting::SurfaceOptions options{.band = job.scene.band, .progress = {}};
  const cutting::Surface surface = error_free_sweep(job, options).surface(design_w);
  ReachableArea reach;
  double judged_area = 0.0, reached_area = 0.0;
  for (Index i = 0; i < design_w.vertices.rows(); ++i) {
    const VertexStatus status = surface.status[std::size_t(i)];
    if (status == VertexStatus::Outside) continue;
    ++reach.vertex_count;
    judged_area += design_w.area[i];
    if (status != VertexStatus::Uncut) reached_area += design_w.area[i];
    if (status == VertexStatus::Cut) reach.cut += design_w.area[i];
  }
  if (judged_area > 0.0) {
    reach.reached_fraction = reached_area / judged_area;
    reach.cut /= judged_area;
  }
  return reach;
}

cutting::Design thin_out(cutting::Design design, std::ptrdiff_t max_judged) {
  design.judged.resize(std::size_t(design.vertices.rows()), 1);
  const auto stride = 1 + std::count(design.judged.begin(), design.judged.end(), 1) / max_judged;
  std::ptrdiff_t number = 0;
  for (std::uint8_t& judged : design.judged) judged = judged && number++ % stride == 0;
  return design;
}

namespace {

/// Returns the positions of the rotary axes.
std::vector<double> rotary_positions(const Segment& segment, std::size_t sample) {
  std::vector<double> angles;
  for (int j = 0; j < segment.machine.nominal.size(); ++j)
    if (segment.machine.nominal.joints()[std::size_t(j)].motion == kinematics::Motion::Rotary)
      angles.push_back(segment.samples.states[sample].q[j]);
  return angles;
}

/// Returns the first `max_count` different sets of rotary positions at which a program feeds.
std::vector<std::vector<double>> feed_orientations(const Job& job, std::size_t max_count) {
  std::vector<std::vector<double>> orientations;
  for (std::size_t i = 0; i < job.samples.block.size() && orientations.size() < max_count; ++i) {
    if (!is_feed_sample(job.path, job.samples, i)) continue;
    std::vector<double> angles = rotary_positions(job, i);
    if (std::ranges::find(orientations, angles) == orientations.end())
      orientations.push_back(std::move(angles));
  }
  return orientations;
}

/// Keeps only those blocks of a segment in feed that run at the given rotary positions.
void keep_feed_at(Segment& segment, const std::vector<double>& angles) {
  for (std::size_t i = 0; i < segment.samples.block.size(); ++i)
    if (rotary_positions(segment, i) != angles)
      segment.path.blocks[std::size_t(segment.samples.block[i])].interpolation =
          program::Interpolation::Rapid;
}

/// Returns the job with only those blocks in feed that run at the given rotary positions.
Job keep_feed_at(Job job, const std::vector<double>& angles) {
  keep_feed_at(static_cast<Segment&>(job), angles);
  for (Segment& segment : job.segments) keep_feed_at(segment, angles);
  return job;
}

/// Measure of how well a program fits a design.
struct FitQuality {
  double median = infinity;  // mm, of the magnitudes of the error-free residuals
  double uncut = 1.0;        // fraction of the vertices
  // Returns the cost by which shifts are compared, mm. With the default band of 20 mm an uncut
  // fraction of 0.05 % weighs as much as 0.01 mm.
  double cost(double band) const { return median + band * uncut; }
};

/// Evaluates shifts of a program relative to its design.
class ProgramShift {
 public:
  ProgramShift(const Job& job, const cutting::Design& thinned_w)
      : job_(job),
        displacement_(job),
        thinned_w_(thinned_w),
        search_band_(cutting::gouge_bands * job.scene.band),
        sweep_(error_free_sweep(job, {.band = search_band_, .progress = {}})) {}

  /// Residuals of the vertices, and their derivatives by the shift.
  struct Residuals {
    std::vector<double> r;    // mm, of vertices cut or gouged
    std::vector<Vector3d> g;  // gradients of `r`
    std::size_t uncut = 0;    // number of vertices
    FitQuality fit(double search_band) const;
  };
  Residuals at(const Vector3d& shift) const;
  FitQuality fit(const Vector3d& shift) const { return at(shift).fit(search_band_); }
  Vector3d refined(Vector3d shift) const;

 private:
  cutting::Surface surface(const Vector3d& shift) const;

  const Job& job_;
  Displacement displacement_;
  const cutting::Design& thinned_w_;
  double search_band_;
  Sweep sweep_;
};

/// Returns the surface after a shift. A milled design is moved in the opposite direction, so that
/// the sweep is prepared only once; a turned part spins, so the poses of the tool are moved.
cutting::Surface ProgramShift::surface(const Vector3d& shift) const {
  if (!displacement_.is_turned()) {
    cutting::Design moved = thinned_w_;
    moved.vertices.rowwise() -= shift.transpose();
    return sweep_.surface(moved);
  }
  if (shift.isZero(0.0)) return sweep_.surface(thinned_w_);
  std::vector<std::vector<Pose>> poses;
  for (const Segment& part : job_segments(job_)) {
    poses.push_back(part.T_wt_nominal);
    for (std::size_t i = 0; i < poses.back().size(); ++i)
      poses.back()[i].translation() += displacement_.at(part, i, shift);
  }
  std::vector<ToolSweep> sweeps;
  for (const Segment& part : job_segments(job_))
    sweeps.push_back({part.scene.tool.nominal, part.samples, poses[sweeps.size()],
                      part.machine.nominal, part.machine.workpiece_spindle, part.path});
  return machined_surface(thinned_w_, sweeps, {.band = search_band_, .progress = {}});
}

ProgramShift::Residuals ProgramShift::at(const Vector3d& shift) const {
  const cutting::Surface surface = this->surface(shift);
  const auto gradient = [&](Index i) {
    return displacement_.gradient(thinned_w_.vertices.row(i), thinned_w_.normals.row(i));
  };
  Residuals residuals;
  for (Index i = 0; i < thinned_w_.vertices.rows(); ++i) {
    const auto status = surface.status[std::size_t(i)];
    if (status == cutting::VertexStatus::Uncut) ++residuals.uncut;
    if (status != cutting::VertexStatus::Cut) continue;
    residuals.r.push_back(surface.residual[i]);
    residuals.g.push_back(gradient(i));
  }
  for (const cutting::Gouge& gouge : surface.gouges) {
    residuals.r.push_back(-gouge.depth);
    residuals.g.push_back(gradient(gouge.vertex));
  }
  return residuals;
}

FitQuality ProgramShift::Residuals::fit(double search_band) const {
  // The residual of an uncut vertex is at least the search band.
  std::vector<double> magnitudes(uncut, search_band);
  for (const double residual : r) magnitudes.push_back(std::abs(residual));
  if (magnitudes.empty()) return {};
  const auto median = magnitudes.begin() + std::ptrdiff_t(magnitudes.size() / 2);
  std::nth_element(magnitudes.begin(), median, magnitudes.end());
  return {*median, double(uncut) / double(magnitudes.size())};
}

/// Returns the shift d that minimises the sum of |r + g d|, by iteratively reweighted least
/// squares. Unlike squares, magnitudes give little weight to vertices that another pass cuts.
/// Directions perpendicular to all gradients stay zero.
Vector3d least_magnitudes_shift(const ProgramShift::Residuals& residuals) {
  constexpr int max_iterations = 30;
  constexpr double min_residual = 1e-4;  // mm, bounds the weights
  constexpr double min_eigenvalue_ratio =
      1e-3;  // to the largest; below it a direction is undetermined
  Vector3d d = Vector3d::Zero();
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Eigen::Matrix3d N = Eigen::Matrix3d::Zero();
    Vector3d g = Vector3d::Zero();
    for (std::size_t i = 0; i < residuals.r.size(); ++i) {
      const double weight =
          1.0 / std::max(min_residual, std::abs(residuals.r[i] + residuals.g[i].dot(d)));
      N += weight * residuals.g[i] * residuals.g[i].transpose();
      g -= weight * residuals.r[i] * residuals.g[i];
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(N);
    Vector3d solution = Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      if (axes.eigenvalues()[k] > min_eigenvalue_ratio * axes.eigenvalues()[2])
        solution +=
            axes.eigenvectors().col(k) * axes.eigenvectors().col(k).dot(g) / axes.eigenvalues()[k];
    const double change = (solution - d).norm();
    d = solution;
    // 0.1 nm is well below the 1 um to which offsets are rounded.
    if (change < 1e-7) break;
  }
  return d;
}

/// Returns the shift of least cost near a given one. The machined surface moves with the program,
/// so that each residual changes by its gradient times the shift. Other passes then form the
/// surface, so the step is repeated.
Vector3d ProgramShift::refined(Vector3d shift) const {
  constexpr int max_iterations = 12;
  Vector3d best = shift;
  double least_cost = infinity;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Residuals residuals = at(shift);
    const double cost = residuals.fit(search_band_).cost(search_band_);
    if (cost < least_cost) {
      least_cost = cost;
      best = shift;
    }
    if (residuals.r.empty()) break;
    const Vector3d step = least_magnitudes_shift(residuals);
    // 0.1 um, since offsets are rounded to 1 um.
    if (step.norm() < 1e-4) break;
    // Beyond the search band other vertices would be cut than those that gave the step.
    shift += std::min(1.0, search_band_ / step.norm()) * step;
  }
  return best;
}

/// Returns the shift with which a program fits its part best. The search starts from the present
/// position and from the first contact, each as it is and with the middle of the feed moved to the
/// middle of the part.
Vector3d best_fit_shift(const Job& job, const cutting::Design& thinned_w,
                        const Vector3d& contact_shift) {
  const ProgramShift program(job, thinned_w);
  const Displacement displacement(job);
  const Eigen::Matrix3d steps = displacement.steps(job);
  const Spans feed = swept_spans(job).tip, part = part_spans(job);
  const auto centred = [&](const Vector3d& shift) -> Vector3d {
    // A turned part is centred along the spindle, a milled one in x and y.
    const std::size_t centred_count = displacement.is_turned() ? 1 : 2;
    Vector3d coordinates = steps.transpose() * shift;
    for (std::size_t k = 0; k < centred_count; ++k)
      coordinates[Index(k)] = part[k].middle() - feed[k].middle();
    return steps * coordinates;
  };
  const double search_band = cutting::gouge_bands * job.scene.band;
  Vector3d best = Vector3d::Zero();
  double least_cost = program.fit(best).cost(search_band);
  const auto consider = [&](const Vector3d& start) {
    const Vector3d shift = program.refined(start);
    const double cost = program.fit(shift).cost(search_band);
    if (cost >= least_cost - 1e-5) return;  // of equal shifts the first stays
    least_cost = cost;
    best = shift;
  };
  consider(Vector3d::Zero());
  consider(contact_shift);
  consider(centred(best));
  consider(centred(contact_shift));
  // Uncut vertices show how far a flank extends along itself, residuals do not. They have no
  // gradient, so the best shift is varied in steps of 1 mm and 0.25 mm.
  for (const double step : {1.0, 0.25}) {
    bool is_better = true;
    for (int iteration = 0; is_better && iteration < 8; ++iteration) {
      is_better = false;
      for (Index k = 0; k < 3; ++k)
        for (const double sign : {-1.0, 1.0}) {
          if (steps.col(k).isZero(0.0)) continue;
          const Vector3d shift = best + sign * step * steps.col(k);
          const double cost = program.fit(shift).cost(search_band);
          if (cost >= least_cost - 1e-5) continue;
          least_cost = cost;
          best = shift;
          is_better = true;
        }
    }
  }
  // A program with a larger median is for another part, or reaches only a few points of this one.
  constexpr double max_median = 0.1;  // mm
  const FitQuality best_fit = program.fit(best);
  if (!(best_fit.median < max_median)) return contact_shift;
  // Many offsets are equally good, since cusps raise the median by their height. The intended one
  // is most probably a round number.
  const double tolerance = std::max(0.01, best_fit.median);  // mm
  for (const double step : {1.0, 0.1, 0.01}) {
    const Vector3d rounded_shift = step * (best / step).array().round().matrix();
    if (program.fit(rounded_shift).cost(search_band) < least_cost + tolerance) return rounded_shift;
  }
  return best;
}

/// Returns "touches" or "fits best: half of the judged vertices tried are within 0.31 um of the
/// design".
std::string fit_text(const FitQuality& fit, double band) {
  if (!(fit.median < band)) return "touches";
  // Below 1 nm the figure is rounding.
  return fmt::format("fits best: half of the tested vertices are within {:.2g} um of the design",
                     std::max(fit.median, units::nm) / units::um);
}

/// Returns the suggestion for a shift: as work offsets if those of the program make the tool cut
/// the part, otherwise as part.at_mm. None if neither does.
/// @param moved_feed  the job, or the job with only that feed which is moved to the part
std::optional<PlacementSuggestion> suggest_shift(const Job& job, const Job& moved_feed,
                                                 const cutting::Design& thinned_w,
                                                 const Vector3d& shift) {
  if (!(shift.norm() > 0.0)) return std::nullopt;
  const double band = job.scene.band;
  const auto fit_words = [&](const Job& shifted_job, const cutting::Design& design_w) {
    return fit_text(ProgramShift(shifted_job, design_w).fit(Vector3d::Zero()), band);
  };
  const Displacement displacement(moved_feed);
  if (const auto shifted = shift_offsets(moved_feed, displacement, shift))
    if (const auto shifted_job = error_free_job(shifted->scene))
      if (const ReachableArea reach = reachable_area(thinned_w, *shifted_job);
          reach.reached_fraction > 0.0)
        return PlacementSuggestion{
            fmt::format("with {} it {}", shifted->offsets_text, fit_words(*shifted_job, thinned_w)),
            reach};
  if (displacement.is_turned() && shift[1] != 0.0)
    return std::nullopt;  // the part must stay on the spindle
  const Vector3d shift_w = displacement.at(moved_feed, 0, shift);
  cutting::Design shifted_part = thinned_w;
  shifted_part.vertices.rowwise() -= shift_w.transpose();
  const ReachableArea reach = reachable_area(shifted_part, job);
  if (!(reach.reached_fraction > 0.0)) return std::nullopt;
  const Vector3d position_w = job.scene.part.T_wm.translation() - shift_w;
  return PlacementSuggestion{fmt::format("with part.at_mm = [{:.6g}, {:.6g}, {:.6g}] it {}",
                                         round_to_um(position_w.x()), round_to_um(position_w.y()),
                                         round_to_um(position_w.z()), fit_words(job, shifted_part)),
                             reach};
}

std::optional<PlacementSuggestion> suggest_placement(const Job& job, const Job& moved_feed,
                                                     const cutting::Design& thinned_w) {
  const bool is_milled = std::holds_alternative<cutting::Cutter>(job.scene.tool.nominal);
  const Vector3d contact_shift =
      is_milled ? milled_shift(moved_feed, thinned_w) : turned_shift(moved_feed);
  if (auto suggestion = suggest_shift(job, moved_feed, thinned_w,
                                      best_fit_shift(moved_feed, thinned_w, contact_shift)))
    return suggestion;
  // A shift to the first contact may still help, for instance if only one of several tools comes
  // near the part.
  return suggest_shift(job, moved_feed, thinned_w, contact_shift);
}

}  // namespace

std::optional<PlacementSuggestion> placement_suggestion(const Job& job) {
  constexpr std::size_t max_orientations = 3;  // each takes a full search
  // A search tries a hundred shifts. Vertices on sides and undersides that no shift cuts take most
  // of its time.
  constexpr std::ptrdiff_t max_vertices = 500;
  if (job.windows) return std::nullopt;
  const cutting::Design thinned_w = thin_out(job.design_w, max_vertices);
  if (auto suggestion = suggest_placement(job, job, thinned_w)) return suggestion;
  if (Displacement(job).is_turned()) return std::nullopt;
  // If the rotary axes turn between feeds, an offset moves the feed of each orientation in another
  // direction of the workpiece.
  const auto orientations = feed_orientations(job, max_orientations);
  if (orientations.size() < 2) return std::nullopt;
  for (const std::vector<double>& angles : orientations)
    if (auto suggestion = suggest_placement(job, keep_feed_at(job, angles), thinned_w)) {
      suggestion->words +=
          fmt::format(", {:.3g} % of the judged area", 100.0 * suggestion->reach.reached_fraction);
      return suggestion;
    }
  return std::nullopt;
}

}  // namespace abbe::sim
