#include "sim/cut/placement_suggestion.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "kinematics/decompositions.h"
#include "kinematics/jacobian.h"
#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/cut/tool_motion.h"

namespace abbe::sim {

namespace {

using Eigen::Index;
using Eigen::Vector3d;
using kinematics::AxisVector;
using kinematics::Pose;

bool overlap(const Span& a, const Span& b) { return a.low <= b.high && b.low <= a.high; }

bool is_feed_sample(const Job& job, std::size_t sample) {
  return program::is_feed(job.path.blocks[std::size_t(job.samples.block[sample])]);
}

/// Returns the motion of a milling cutter in feed only. Between two feeds the cutter leaves upwards
/// and travels 10 m above the part, where it meets nothing; its axis turns upwards meanwhile.
cutting::CutterMotion feed_motion(const Job& job) {
  constexpr double far = 1e4;  // mm
  const cutting::CutterMotion all = cutter_motion(job.T_wt_nominal, job.samples);
  const Eigen::Matrix3d R_wm = job.scene.part.T_wm.linear();
  std::vector<Vector3d> tip, axis;
  std::vector<Index> from;
  const auto add = [&](Index i) {
    tip.push_back(all.tip.row(i));
    axis.push_back(all.axis.row(i));
    from.push_back(i);
  };
  const auto add_far_above = [&](Index i) {
    add(i);
    tip.back() += far * R_wm.col(2);
    // An axis that points downwards would turn through the undefined opposite direction, so it
    // turns sideways.
    axis.back() = (axis.back() + R_wm.col(2)).norm() > 0.1 ? R_wm.col(2) : R_wm.col(0);
  };
  for (Index i = 1; i < all.tip.rows(); ++i) {
    if (!is_feed_sample(job, std::size_t(i))) continue;
    if (from.empty() || from.back() != i - 1) {
      if (!from.empty()) add_far_above(from.back());
      if (!from.empty()) add_far_above(i - 1);
      add(i - 1);
    }
    add(i);
  }
  cutting::CutterMotion feed;
  const Index n = Index(from.size());
  feed.tip.resize(n, 3);
  feed.axis.resize(n, 3);
  feed.time_s.resize(n);
  for (Index k = 0; k < n; ++k) {
    feed.tip.row(k) = tip[std::size_t(k)];
    feed.axis.row(k) = axis[std::size_t(k)];
    feed.time_s[k] = all.time_s[from[std::size_t(k)]];
    feed.line.push_back(all.line[std::size_t(from[std::size_t(k)])]);
  }
  return feed;
}

/// Returns the height of the feed above the part, moved by `by_w`, along the z axis of the part,
/// mm: the minimum over the judged vertices, negative if it lies below. None if no vertex has the
/// feed above or below it.
std::optional<double> height_above(const Job& job, const cutting::Design& few_w,
                                   const Vector3d& by_w, double most) {
  const bool feeds = std::any_of(job.path.blocks.begin(), job.path.blocks.end(), program::is_feed);
  cutting::Design rays = few_w;
  rays.triangles.resize(0, 3);
  rays.vertices.rowwise() += by_w.transpose();
  rays.normals.rowwise() = job.scene.part.T_wm.linear().col(2).transpose();
  std::optional<double> least;
  for (const Job& part : parts_of(job)) {
    const cutting::CutterMotion motion =
        feeds ? feed_motion(part) : cutter_motion(part.T_wt_nominal, part.samples);
    if (motion.tip.rows() == 0) continue;
    const cutting::Surface surface =
        cutting::milled_surface(rays, std::get<cutting::Cutter>(part.scene.tool.nominal), motion,
                                {.band = most, .progress = {}});
    for (Index i = 0; i < surface.residual.size(); ++i)
      if (surface.status[std::size_t(i)] == cutting::VertexStatus::Cut)
        least = std::min(least.value_or(infinity), surface.residual[i]);
  }
  return least;
}

/// Returns the shift of the program of a milled part to its first contact, mm, workpiece frame.
Vector3d milled_shift(const Job& job, const cutting::Design& few_w) {
  const SweptSpans swept = swept_spans(job);
  const Spans part = part_spans(job);
  Vector3d by_m = Vector3d::Zero();
  // Only coordinates without overlap are shifted: a program beside the part in x needs no other y.
  for (std::size_t k = 0; k < 2; ++k)
    if (!overlap(part[k], swept.feed[k])) by_m[Index(k)] = part[k].middle() - swept.tip[k].middle();
  const Eigen::Matrix3d R_wm = job.scene.part.T_wm.linear();
  // The search along z must span from the highest sweep to the lowest point of the part, and back.
  const double most = std::max(std::abs(swept.all[2].high - part[2].low),
                               std::abs(part[2].high - swept.all[2].low)) +
                      job.scene.band;
  const auto above = height_above(job, few_w, -(R_wm * by_m), most);
  if (above)
    by_m.z() = -*above;
  else if (!overlap(part[2], swept.feed[2]))
    by_m.z() = part[2].high - swept.feed[2].low;
  return R_wm * by_m;
}

/// Returns the first sample in feed, or 0 if there is none.
std::size_t first_feed(const Job& job) {
  for (std::size_t i = 0; i < job.samples.block.size(); ++i)
    if (is_feed_sample(job, i)) return i;
  return 0;
}

/// Returns the shift of a turned part: mm along the spindle, and radially to the nearest radius.
Vector3d turned_shift(const Job& job) {
  const SweptSpans swept = swept_spans(job);
  const Spans part = part_spans(job);
  Vector3d shift = Vector3d::Zero();
  if (!overlap(part[0], swept.feed[0])) shift[0] = part[0].middle() - swept.tip[0].middle();
  if (!overlap(part[1], swept.feed[1]))
    shift[1] = swept.feed[1].low > part[1].high ? part[1].high - swept.feed[1].low
                                                : part[1].low - swept.feed[1].high;
  return shift;
}

/// The displacement of a program by a change of offsets, in three numbers, mm: for a milled part
/// along x y z of the workpiece; for a turned part, which spins, along the spindle and radially in
/// the bed frame, with the third zero.
class Displacement {
 public:
  explicit Displacement(const Job& job)
      : turned_(!std::holds_alternative<cutting::Cutter>(job.scene.tool.nominal)) {
    if (!turned_) return;
    line_ = spindle_line(job.machine.nominal, *job.machine.workpiece_spindle);
    const std::size_t first = first_feed(job);
    const Vector3d arm = job.T_wt_nominal[first].translation() - line_.point_w;
    const Vector3d out = arm - arm.dot(line_.direction_w) * line_.direction_w;
    // A tool that begins on the spindle axis has no radial direction and moves along the spindle
    // only; 1 nm is above the rounding of a pose.
    if (out.norm() > 1e-6) out_b_ = bed_in_workpiece(job, first).transpose() * out.normalized();
  }

  bool turned() const { return turned_; }
  /// Directions, in columns, in which a search may step.
  Eigen::Matrix3d steps(const Job& job) const {
    if (!turned_) return job.scene.part.T_wm.linear();
    return Vector3d(1.0, out_b_.norm(), 0.0).asDiagonal();
  }
  /// Returns the displacement of the tool at a sample of a part of the job, mm, workpiece frame.
  Vector3d at(const Job& part, std::size_t sample, const Vector3d& d) const {
    if (!turned_) return d;
    return d[0] * line_.direction_w + d[1] * (bed_in_workpiece(part, sample) * out_b_);
  }
  /// Returns the derivative of a residual by each of the three numbers.
  Vector3d gradient(const Vector3d& p_w, const Vector3d& n_w) const {
    if (!turned_) return n_w;
    const Vector3d arm = p_w - line_.point_w;
    const Vector3d out = arm - arm.dot(line_.direction_w) * line_.direction_w;
    const double radial = out.norm() > 1e-9 ? n_w.dot(out.normalized()) : 0.0;
    return {n_w.dot(line_.direction_w), radial * out_b_.norm(), 0.0};
  }

 private:
  static Eigen::Matrix3d bed_in_workpiece(const Job& part, std::size_t sample) {
    return part.machine.nominal.workpiece_in_bed(part.samples.states[sample].q)
        .linear()
        .transpose();
  }
  bool turned_;
  SpindleLine line_{Vector3d::Zero(), Vector3d::UnitZ()};
  Vector3d out_b_ = Vector3d::Zero();
};

// Rounds to 1 um; adding zero removes the sign of -0.
double rounded(double mm) { return std::round(mm * 1e3) / 1e3 + 0.0; }

/// Returns the change of the programmed axis positions for a shift of the tip; none if the slides
/// cannot make it.
std::optional<AxisVector> change_of_words(const Job& job, std::size_t sample,
                                          const Vector3d& shift_w) {
  const kinematics::Chain& chain = job.machine.nominal;
  AxisVector change = AxisVector::Zero(chain.size());
  const program::Block& block = job.path.blocks[std::size_t(job.samples.block[sample])];
  if (block.coordinates == program::Coordinates::Tip) {
    for (const char name : {'X', 'Y', 'Z'}) change[*chain.find(name)] = shift_w[name - 'X'];
  } else {
    const auto J = kinematics::axis_jacobian(chain, job.samples.states[sample].q);
    Eigen::MatrixXd by_slide = Eigen::MatrixXd::Zero(3, chain.size());
    for (int j = 0; j < chain.size(); ++j)
      if (chain.joints()[std::size_t(j)].motion == kinematics::Motion::Linear)
        by_slide.col(j) = J.col(j).head<3>();
    change = shortest_least_squares(by_slide, shift_w);
    // 1e-6 of the shift: a machine without one of the three slides leaves far more
    if ((by_slide * change - shift_w).norm() > 1e-6 * shift_w.norm()) return std::nullopt;
  }
  for (int j = 0; j < change.size(); ++j) change[j] = rounded(change[j]);
  return change;
}

/// A scene with changed work offsets, and a text of the change.
struct Shifted {
  Scene scene;
  std::string words;
};

// Returns the scene with changed work offsets; none if the program has none that help.
std::optional<Shifted> with_offsets(const Job& job, const Displacement& displacement,
                                    const Vector3d& shift) {
  if (!std::holds_alternative<ProgramDescription::File>(job.scene.program.source))
    return std::nullopt;
  Shifted shifted{job.scene, ""};
  const program::NcOptions control = nc_options(job.scene, job.machine);
  // A stated offset counts from another point than no offset, so the difference is subtracted
  // below.
  const auto zero = program::program_zero(control) ? std::nullopt : program::known_zero(control);
  std::set<int> done;
  for (std::size_t i = 0; i < job.samples.block.size(); ++i) {
    const program::Block& block = job.path.blocks[std::size_t(job.samples.block[i])];
    const int used = block.work_offset;
    if (!is_feed_sample(job, i) || !done.insert(used).second) continue;
    if (used < 0 || std::size_t(used) >= job.scene.program.work_offset.size() ||
        job.scene.program.offsets)
      return std::nullopt;  // another key than `work_offset` of the scene sets the offset
    const auto change = change_of_words(job, i, displacement.at(job, i, shift));
    if (!change) return std::nullopt;
    AxisVector& offset = shifted.scene.program.work_offset[std::size_t(used)];
    if (offset.size() == 0) offset = AxisVector::Zero(change->size());
    const Vector3d more = program::offset_correction(zero, block.coordinates);
    std::string words;
    for (int j = 0; j < change->size(); ++j) {
      const double now = offset[j];
      const char name = job.machine.nominal.joints()[std::size_t(j)].name;
      offset[j] += (*change)[j];
      if (name >= 'X' && name <= 'Z') offset[j] -= more[name - 'X'];
      if (offset[j] == now) continue;
      words += fmt::format(" {} = {:.6g}", name, rounded(offset[j]));
      if (now != 0.0) words += fmt::format(" (now {:.6g})", now);
    }
    shifted.words += fmt::format("{}G{}{}", shifted.words.empty() ? "" : ", ", 54 + used, words);
  }
  if (shifted.words.empty()) return std::nullopt;
  return shifted;
}

/// Returns the job of a changed scene on the error-free machine, with the program read again; none
/// if the axes cannot run it.
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
  double judged = 0.0, reached = 0.0;
  for (Index i = 0; i < design_w.vertices.rows(); ++i) {
    const VertexStatus status = surface.status[std::size_t(i)];
    if (status == VertexStatus::Outside) continue;
    ++reach.tried;
    judged += design_w.area[i];
    if (status != VertexStatus::Uncut) reached += design_w.area[i];
    if (status == VertexStatus::Cut) reach.cut += design_w.area[i];
  }
  if (judged > 0.0) {
    reach.share = reached / judged;
    reach.cut /= judged;
  }
  return reach;
}

cutting::Design thinned(cutting::Design design) {
  // With 2000 vertices each stands for 0.05 % of the area.
  constexpr std::ptrdiff_t most = 2000;
  design.judged.resize(std::size_t(design.vertices.rows()), 1);
  const auto every = 1 + std::count(design.judged.begin(), design.judged.end(), 1) / most;
  std::ptrdiff_t number = 0;
  for (std::uint8_t& judged : design.judged) judged = judged && number++ % every == 0;
  return design;
}

namespace {

/// Returns the positions of the rotary axes.
std::vector<double> turned_to(const Job& job, std::size_t sample) {
  std::vector<double> angles;
  for (int j = 0; j < job.machine.nominal.size(); ++j)
    if (job.machine.nominal.joints()[std::size_t(j)].motion == kinematics::Motion::Rotary)
      angles.push_back(job.samples.states[sample].q[j]);
  return angles;
}

/// Returns up to `most` different sets of rotary positions in which a program feeds, in the order
/// of the program.
std::vector<std::vector<double>> feed_directions(const Job& job, std::size_t most) {
  std::vector<std::vector<double>> found;
  for (std::size_t i = 0; i < job.samples.block.size() && found.size() < most; ++i) {
    if (!is_feed_sample(job, i)) continue;
    std::vector<double> angles = turned_to(job, i);
    if (std::ranges::find(found, angles) == found.end()) found.push_back(std::move(angles));
  }
  return found;
}

/// Returns the job with only those blocks in feed that run at the given rotary positions.
Job feeding_only(Job job, const std::vector<double>& angles) {
  for (std::size_t i = 0; i < job.samples.block.size(); ++i)
    if (turned_to(job, i) != angles)
      job.path.blocks[std::size_t(job.samples.block[i])].interpolation =
          program::Interpolation::Rapid;
  for (Job& stretch : job.stretches) stretch = feeding_only(std::move(stretch), angles);
  return job;
}

/// Measure of how well a program fits a design.
struct Fit {
  double median =
      infinity;        // mm, of the magnitudes of the error-free residuals at the vertices tried
  double uncut = 1.0;  // fraction of the vertices tried
  // Cost by which shifts are compared. With a search of 20 mm, the default, 0.05 % uncut weighs as
  // much as 0.01 mm.
  double cost(double band) const { return median + band * uncut; }
};

/// Tries displacements of the program of a part against its design.
class ShiftTrial {
 public:
  ShiftTrial(const Job& job, const cutting::Design& few_w)
      : job_(job),
        displacement_(job),
        few_w_(few_w),
        search_(cutting::gouge_bands * job.scene.band),
        sweep_(error_free_sweep(job, {.band = search_, .progress = {}})) {}

  /// Residuals at the vertices tried, and their derivatives by the displacement.
  struct Residuals {
    std::vector<double> r;    // mm, of vertices cut or gouged
    std::vector<Vector3d> g;  // gradients of `r`
    std::size_t uncut = 0;
    Fit fit(double search) const;
  };
  Residuals at(const Vector3d& shift) const;
  Fit fit(const Vector3d& shift) const { return at(shift).fit(search_); }
  Vector3d refined(Vector3d shift) const;

 private:
  cutting::Surface surface(const Vector3d& shift) const;

  const Job& job_;
  Displacement displacement_;
  const cutting::Design& few_w_;
  double search_;
  Sweep sweep_;
};

/// Returns the surface after a shift. For a milled part the design is moved the opposite way, so
/// that the sweep is built once; a turned part spins, so its poses are moved.
cutting::Surface ShiftTrial::surface(const Vector3d& shift) const {
  if (!displacement_.turned()) {
    cutting::Design moved = few_w_;
    moved.vertices.rowwise() -= shift.transpose();
    return sweep_.surface(moved);
  }
  if (shift.isZero(0.0)) return sweep_.surface(few_w_);
  std::vector<std::vector<Pose>> poses;
  for (const Job& part : parts_of(job_)) {
    poses.push_back(part.T_wt_nominal);
    for (std::size_t i = 0; i < poses.back().size(); ++i)
      poses.back()[i].translation() += displacement_.at(part, i, shift);
  }
  std::vector<ToolSweep> sweeps;
  for (const Job& part : parts_of(job_))
    sweeps.push_back({part.scene.tool.nominal, part.samples, poses[sweeps.size()],
                      part.machine.nominal, part.machine.workpiece_spindle});
  return machined_surface(few_w_, sweeps, {.band = search_, .progress = {}});
}

ShiftTrial::Residuals ShiftTrial::at(const Vector3d& shift) const {
  const cutting::Surface surface = this->surface(shift);
  const auto gradient = [&](Index i) {
    return displacement_.gradient(few_w_.vertices.row(i), few_w_.normals.row(i));
  };
  Residuals found;
  for (Index i = 0; i < few_w_.vertices.rows(); ++i) {
    const auto status = surface.status[std::size_t(i)];
    if (status == cutting::VertexStatus::Uncut) ++found.uncut;
    if (status != cutting::VertexStatus::Cut) continue;
    found.r.push_back(surface.residual[i]);
    found.g.push_back(gradient(i));
  }
  for (const cutting::Gouge& gouge : surface.gouges) {
    found.r.push_back(-gouge.depth);
    found.g.push_back(gradient(gouge.vertex));
  }
  return found;
}

Fit ShiftTrial::Residuals::fit(double search) const {
  // an uncut vertex counts as a residual of the whole search
  std::vector<double> size(uncut, search);
  for (const double one : r) size.push_back(std::abs(one));
  if (size.empty()) return {};
  const auto middle = size.begin() + std::ptrdiff_t(size.size() / 2);
  std::nth_element(size.begin(), middle, size.end());
  return {*middle, double(uncut) / double(size.size())};
}

/// Returns the shift d that minimises the sum of the magnitudes of r + g d, by iteratively
/// reweighted least squares. Magnitudes instead of squares: vertices that another pass cuts do not
/// pull the result. Directions perpendicular to all gradients stay zero.
Vector3d min_magnitudes(const ShiftTrial::Residuals& all) {
  constexpr int turns = 30;
  constexpr double nearest = 1e-4;  // mm: smaller residuals have the same weight, so that no weight
                                    // is infinite
  constexpr double determined = 1e-3;  // fraction of the largest eigenvalue below which a direction
                                       // is undetermined
  Vector3d d = Vector3d::Zero();
  for (int turn = 0; turn < turns; ++turn) {
    Eigen::Matrix3d N = Eigen::Matrix3d::Zero();
    Vector3d g = Vector3d::Zero();
    for (std::size_t i = 0; i < all.r.size(); ++i) {
      const double weight = 1.0 / std::max(nearest, std::abs(all.r[i] + all.g[i].dot(d)));
      N += weight * all.g[i] * all.g[i].transpose();
      g -= weight * all.r[i] * all.g[i];
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(N);
    Vector3d next = Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      if (axes.eigenvalues()[k] > determined * axes.eigenvalues()[2])
        next +=
            axes.eigenvectors().col(k) * axes.eigenvectors().col(k).dot(g) / axes.eigenvalues()[k];
    const double change = (next - d).norm();
    d = next;
    // 0.1 nm, well below the micrometre of an offset
    if (change < 1e-7) break;
  }
  return d;
}

/// Returns the shift near a given one at which the median of the magnitudes is smallest. The
/// machined surface moves with the program, so each residual changes by its gradient times the
/// shift. Other passes then form the surface, so the step is repeated until nothing is gained.
Vector3d ShiftTrial::refined(Vector3d shift) const {
  constexpr int max_turns = 12;
  Vector3d best = shift;
  double least = infinity;
  for (int turn = 0; turn < max_turns; ++turn) {
    const Residuals residuals = at(shift);
    const double cost = residuals.fit(search_).cost(search_);
    if (cost < least) {
      least = cost;
      best = shift;
    }
    if (residuals.r.empty()) break;
    const Vector3d step = min_magnitudes(residuals);
    // 0.1 um: offsets are rounded to 1 um
    if (step.norm() < 1e-4) break;
    // a step beyond the search leaves the vertices whose residuals it was derived from
    shift += std::min(1.0, search_ / step.norm()) * step;
  }
  return best;
}

/// Returns the shift at which a program fits its part best. Four starts: the present position and
/// the first contact, each as it is and with the middle of the feed over that of the part.
Vector3d fitting_shift(const Job& job, const cutting::Design& few_w, const Vector3d& touching) {
  const ShiftTrial trial(job, few_w);
  const Displacement displacement(job);
  const Eigen::Matrix3d steps = displacement.steps(job);
  const Spans feed = swept_spans(job).tip, part = part_spans(job);
  const auto centred = [&](const Vector3d& shift) -> Vector3d {
    // 1: along the spindle; 2: x and y.
    const std::size_t directions = displacement.turned() ? 1 : 2;
    Vector3d by = steps.transpose() * shift;
    for (std::size_t k = 0; k < directions; ++k) by[Index(k)] = part[k].middle() - feed[k].middle();
    return steps * by;
  };
  const double search = cutting::gouge_bands * job.scene.band;
  Vector3d best = Vector3d::Zero();
  double least = trial.fit(best).cost(search);
  const auto consider = [&](const Vector3d& start) {
    const Vector3d shift = trial.refined(start);
    const double cost = trial.fit(shift).cost(search);
    if (cost >= least - 1e-5) return;  // the first of two equal ones
    least = cost;
    best = shift;
  };
  consider(Vector3d::Zero());
  consider(touching);
  consider(centred(best));
  consider(centred(touching));
  // Residuals do not show how far a flank reaches along itself, the uncut vertices do; so the best
  // shift is moved in steps of 1 mm and 0.25 mm, which no gradient gives.
  for (const double step : {1.0, 0.25}) {
    bool better = true;
    for (int turn = 0; better && turn < 8; ++turn) {
      better = false;
      for (Index k = 0; k < 3; ++k)
        for (const double sign : {-1.0, 1.0}) {
          if (steps.col(k).isZero(0.0)) continue;
          const Vector3d shift = best + sign * step * steps.col(k);
          const double cost = trial.fit(shift).cost(search);
          if (cost >= least - 1e-5) continue;
          least = cost;
          best = shift;
          better = true;
        }
    }
  }
  // A program with a larger median is not of this part, or reaches only a few of its points.
  constexpr double fits = 0.1;  // mm
  const Fit found = trial.fit(best);
  if (!(found.median < fits)) return touching;
  // Cusps raise the median by their height, so many offsets are equally good; the roundest is most
  // probably the one intended.
  const double as_good = std::max(0.01, found.median);  // mm
  for (const double step : {1.0, 0.1, 0.01}) {
    const Vector3d round = step * (best / step).array().round().matrix();
    if (trial.fit(round).cost(search) < least + as_good) return round;
  }
  return best;
}

/// Returns "touches" or "fits best: half of the judged vertices tried are within 0.31 um of the
/// design".
std::string fit_text(const Fit& fit, double band) {
  if (!(fit.median < band)) return "touches";
  // Below 1 nm the figure is rounding.
  return fmt::format(
      "fits best: half of the judged vertices tried are within {:.2g} um of the design",
      std::max(fit.median, units::nm) / units::um);
}

/// Returns the suggestion for a shift, with work offsets if the program has some that help, else
/// with part.at_mm.
/// @param feeding  the job, or the part of its feed that is moved to the part
std::optional<PlacementSuggestion> moved_by(const Job& job, const Job& feeding,
                                            const cutting::Design& few_w, const Vector3d& shift) {
  if (!(shift.norm() > 0.0)) return std::nullopt;
  const double band = job.scene.band;
  const auto words = [&](const Job& moved, const cutting::Design& design_w) {
    return fit_text(ShiftTrial(moved, design_w).fit(Vector3d::Zero()), band);
  };
  const Displacement displacement(feeding);
  if (const auto shifted = with_offsets(feeding, displacement, shift))
    if (const auto moved = error_free_job(shifted->scene))
      if (const ReachableArea reach = reachable_area(few_w, *moved); reach.share > 0.0)
        return PlacementSuggestion{
            fmt::format("with {} it {}", shifted->words, words(*moved, few_w)), reach};
  if (displacement.turned() && shift[1] != 0.0)
    return std::nullopt;  // the part must stay on the spindle
  const Vector3d shift_w = displacement.at(feeding, 0, shift);
  cutting::Design part = few_w;
  part.vertices.rowwise() -= shift_w.transpose();
  const ReachableArea reach = reachable_area(part, job);
  if (!(reach.share > 0.0)) return std::nullopt;
  const Vector3d at = job.scene.part.T_wm.translation() - shift_w;
  return PlacementSuggestion{
      fmt::format("with part.at_mm = [{:.6g}, {:.6g}, {:.6g}] it {}", rounded(at.x()),
                  rounded(at.y()), rounded(at.z()), words(job, part)),
      reach};
}

std::optional<PlacementSuggestion> make_placement_suggestion(const Job& job, const Job& feeding,
                                                             const cutting::Design& few_w) {
  const bool milled = std::holds_alternative<cutting::Cutter>(job.scene.tool.nominal);
  const Vector3d touching = milled ? milled_shift(feeding, few_w) : turned_shift(feeding);
  if (auto out = moved_by(job, feeding, few_w, fitting_shift(feeding, few_w, touching))) return out;
  // A shift to the first contact may help where no better fit exists, for instance if only one of
  // several tools comes near the part.
  return moved_by(job, feeding, few_w, touching);
}

}  // namespace

std::optional<PlacementSuggestion> placement_suggestion(const Job& job) {
  // three directions at most: each takes a full search
  constexpr std::size_t max_tried = 3;
  if (job.windows) return std::nullopt;
  const cutting::Design few_w = thinned(job.design_w);
  if (auto out = make_placement_suggestion(job, job, few_w)) return out;
  if (Displacement(job).turned()) return std::nullopt;
  // If the axes turn between feeds, one offset moves each direction differently in the workpiece.
  const auto directions = feed_directions(job, max_tried);
  if (directions.size() < 2) return std::nullopt;
  for (const std::vector<double>& angles : directions)
    if (auto out = make_placement_suggestion(job, feeding_only(job, angles), few_w)) {
      out->words += fmt::format(", {:.3g} % of the judged area", 100.0 * out->reach.share);
      return out;
    }
  return std::nullopt;
}

}  // namespace abbe::sim
