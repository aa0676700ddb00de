// Compensators in the loop on small versions of the packaged scenes.

#include "kinematics/inverse_kinematics.h"
#include "kinematics/pose.h"
#include "sim/cut/part.h"
#include "sim/cut/tool_motion.h"
#include "sim/loop/compensate.h"
#include "sim/program/program_writers.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

struct SmallScene {
  const char* file;
  std::vector<Override> changes;
};

const std::vector<Override> coarse_raster = {
    {"program.step_over_mm", "2.0"}, {"program.step_mm", "1.5"}, {"part.vertices", "4000"}};
const std::vector<Override> coarse_flank = {{"program.step_mm", "1.0"}, {"part.vertices", "4000"}};
const std::vector<Override> coarse_mesh = {{"program.step_over_mm", "2.0"},
                                           {"program.step_mm", "1.5"}};
const std::vector<Override> coarse_spiral = {{"program.feed_um_per_rev", "60"},
                                             {"part.vertices", "4000"}};

std::vector<Override> and_more(std::vector<Override> changes, const std::vector<Override>& more) {
  changes.insert(changes.end(), more.begin(), more.end());
  return changes;
}

double weighted_rms(const cutting::Surface& a, const cutting::Surface& b, const Job& job) {
  return cutting::statistics(cutting::minus(a, b), job.design_w).rms.value();
}

void print_apart(const std::string& what, const Apart& d) {
  std::cout << what << ": rms " << d.rms / units::nm << " nm, max " << d.max / units::nm
            << " nm over " << d.vertices << " vertices, cut in one only: " << d.unlike << "\n";
}

class GantryScene : public testing::TestWithParam<SmallScene> {};

TEST_P(GantryScene, PerfectIteratedIdealGivesTheErrorFreeMapBack) {
  const Job job = job_of(GetParam().file, GetParam().changes);
  const Cut error_free = cut_error_free(job);
  const Cut wrong = cut(job);
  const Cut compensated_commands = cut(job, parse_case("perfect-iterated-ideal"));
  const Apart before = apart(wrong.surface, error_free.surface);
  const Apart after = apart(compensated_commands.surface, error_free.surface);
  print_apart(std::string(GetParam().file) + " uncompensated", before);
  print_apart(std::string(GetParam().file) + " iterated", after);
  std::cout << "  weighted by area "
            << weighted_rms(compensated_commands.surface, error_free.surface, job) / units::nm
            << " nm; tip left " << compensated_commands.tip_error.max / units::nm << " nm\n";
  EXPECT_TRUE(compensated_commands.warnings.empty());
  EXPECT_GT(before.rms, 1.0_um);
  EXPECT_GT(after.vertices, 1000);
  EXPECT_EQ(after.unlike, 0);
  EXPECT_LT(after.rms, 1.0_nm);
  EXPECT_LT(weighted_rms(compensated_commands.surface, error_free.surface, job), 1.0_nm);
}

INSTANTIATE_TEST_SUITE_P(Compensation, GantryScene,
                         testing::Values(SmallScene{"gantry_dome.toml", coarse_raster},
                                         SmallScene{"gantry_tilted_flat.toml", coarse_raster},
                                         SmallScene{"cone_frustum.toml", coarse_flank},
                                         SmallScene{"gantry_mesh.toml", coarse_mesh}),
                         [](const auto& scene) {
                           const std::string name = scene.param.file;
                           return name.substr(0, name.find('.'));
                         });

/// What no motion of X and Z can mend, on its own: the slides run without error, but the tip leaves
/// the X-Z plane by the true deviation's y, it moves in that plane by what of the truth is chance
/// and known to nobody, and the tool turns as the truth turns it. The workpiece frame of the
/// platform is that of the bed with all axes at zero.
cutting::Surface uncorrectable(const Job& job) {
  const Truth known = without_random_errors(job.truth);
  const int S = *job.machine.workpiece_spindle;
  cutting::NoseMotion motion;
  motion.spindle_point = Vector3d::Zero();
  motion.spindle_direction = Vector3d::UnitX();
  std::vector<double> spindle, time;
  for (std::size_t i = 0; i < job.samples.states.size(); ++i) {
    const kinematics::AxisState& state = job.samples.states[i];
    if (!time.empty() && state.time_s <= time.back()) continue;
    const double turn = state.q[S], c = std::cos(turn), s = std::sin(turn);
    Matrix3d back;  // by -turn about x
    back << 1, 0, 0, 0, c, s, 0, -s, c;
    const Pose truth = tool_in_workpiece(job.truth, state);
    const Vector3d chance = truth.translation() - tool_in_workpiece(known, state).translation();
    Pose slow = Pose::Identity();
    slow.translation() = back * (job.T_wt_nominal[i].translation() + chance);
    slow.translation().y() +=
        (back * (truth.translation() - job.T_wt_nominal[i].translation() - chance)).y();
    slow.linear() = back * truth.linear();
    motion.T_without_spindle.push_back(slow);
    motion.line.push_back(job.samples.line[i]);
    spindle.push_back(turn);
    time.push_back(state.time_s);
  }
  motion.spindle = Eigen::Map<VectorXd>(spindle.data(), Index(spindle.size()));
  motion.time_s = Eigen::Map<VectorXd>(time.data(), Index(time.size()));
  return cutting::turned_surface(job.design_w, std::get<cutting::Nose>(job.scene.tool.actual),
                                 motion, {job.scene.band, {}});
}

class PlatformScene : public testing::TestWithParam<const char*> {};

TEST_P(PlatformScene, PerfectIteratedIdealLeavesWhatItsTwoSlidesCannotCorrect) {
  const Job job = job_of(GetParam(), coarse_spiral);
  ASSERT_TRUE(job.machine.nominal.T_bw_home().isApprox(Pose::Identity()));
  const Cut error_free = cut_error_free(job);
  const Cut wrong = cut(job);
  const Cut compensated_commands = cut(job, parse_case("perfect-iterated-ideal"));
  const cutting::Surface apart_from_it = uncorrectable(job);
  const std::string name = GetParam();
  print_apart(name + " uncompensated", apart(wrong.surface, error_free.surface));
  print_apart(name + " left over", apart(compensated_commands.surface, error_free.surface));
  print_apart(name + " uncorrectable, computed apart", apart(apart_from_it, error_free.surface));
  const Apart d = apart(compensated_commands.surface, apart_from_it);
  print_apart(name + " left over less uncorrectable", d);
  EXPECT_TRUE(compensated_commands.warnings.empty());
  EXPECT_GT(apart(wrong.surface, error_free.surface).rms, 0.3_um);
  EXPECT_GT(d.vertices, 2000);
  EXPECT_EQ(d.unlike, 0);
  EXPECT_LT(d.rms, 1.0_nm);
  EXPECT_LT(weighted_rms(compensated_commands.surface, apart_from_it, job), 1.0_nm);
}

INSTANTIATE_TEST_SUITE_P(Compensation, PlatformScene,
                         testing::Values("platform_plane.toml", "platform_cone.toml",
                                         "platform_sphere.toml"),
                         [](const auto& scene) {
                           const std::string name = scene.param;
                           return name.substr(0, name.find('.'));
                         });

TEST(Compensation, PositionOnlyLeavesTenTimesWhatDecoupledLeavesOnTheTiltedFlat) {
  const Job job = job_of("gantry_tilted_flat.toml", coarse_raster);
  const Cut error_free = cut_error_free(job);
  const double wrong = weighted_rms(cut(job).surface, error_free.surface, job);
  const double position =
      weighted_rms(cut(job, parse_case("perfect-position-ideal")).surface, error_free.surface, job);
  const double decoupled = weighted_rms(cut(job, parse_case("perfect-decoupled-ideal")).surface,
                                        error_free.surface, job);
  std::cout << "tilted flat, machine part rms: uncompensated " << wrong / units::um
            << " um, position only " << position / units::nm << " nm, decoupled "
            << decoupled / units::nm << " nm, ratio " << position / decoupled << "\n";
  EXPECT_LT(position, wrong);
  EXPECT_GE(position, 10.0 * decoupled);
}

/// Tip error along the program after one decoupled step, where A is above 5 degrees.
double decoupled_tip_rms(const Job& job) {
  const int A = job.machine.nominal.find('A').value();
  const Commands commanded = compensate(job, parse_case("perfect-decoupled-ideal"));
  double sum = 0.0;
  int n = 0;
  for (std::size_t i = 0; i < commanded.samples.states.size(); ++i) {
    if (std::abs(job.samples.states[i].q[A]) < 5.0 * units::deg) continue;
    const Pose reached = tool_in_workpiece(job.truth, commanded.samples.states[i]);
    sum += (reached.translation() - job.T_wt_nominal[i].translation()).squaredNorm();
    ++n;
  }
  EXPECT_GT(n, int(0.9 * double(commanded.samples.states.size())));
  return std::sqrt(sum / n);
}

TEST(Compensation, OneDecoupledStepLeavesATipErrorOfSecondOrder) {
  for (const char* file : {"gantry_dome.toml", "gantry_mesh.toml", "cone_frustum.toml"}) {
    const bool flank = std::string(file) == "cone_frustum.toml";
    double left[3] = {0, 0, 0};
    const char* scale[3] = {"4.0", "2.0", "1.0"};
    for (int k = 0; k < 3; ++k) {
      const std::vector<Override>& coarse = flank ? coarse_flank
                                            : std::string(file) == "gantry_mesh.toml"
                                                ? coarse_mesh
                                                : coarse_raster;
      left[k] = decoupled_tip_rms(job_of(file, and_more(coarse, {{"errors.scale", scale[k]}})));
    }
    const double first = std::log2(left[0] / left[1]), second = std::log2(left[1] / left[2]);
    std::cout << file
              << ": tip error after one decoupled step, errors x 4, 2, 1: " << left[0] / units::nm
              << " " << left[1] / units::nm << " " << left[2] / units::nm << " nm rms; exponents "
              << first << " " << second << "\n";
    EXPECT_NEAR(first, 2.0, 0.1) << file;
    EXPECT_NEAR(second, 2.0, 0.1) << file;
  }
}

TEST(Compensation, RewrittenProgramDiffersFromTheIdealChannelByItsWords) {
  for (const double q : {1e-3, 1e-4, 1e-5}) {
    // as many degrees as millimetres, like the defaults (1e-4 of both)
    const std::string words = fmt::format("{:.9f}", q);
    const Job job = job_of("gantry_dome.toml",
                           and_more(coarse_raster, {{"compensation.word_resolution_mm", words},
                                                    {"compensation.angle_resolution_deg", words}}));
    const Cut ideal = cut(job, parse_case("perfect-iterated-ideal"));
    const Cut program = cut(job, parse_case("perfect-iterated-program"));
    const Apart d = apart(program.surface, ideal.surface);
    print_apart(fmt::format("words of {0} mm and {0} deg", q), d);
    EXPECT_EQ(d.unlike, 0);
    EXPECT_LE(d.rms, q);
    EXPECT_GT(d.rms, 0.01 * q);  // it is rounded
  }
}

/// How far the words of a block are from a corrected command, in words.
double words_off(const Job& job, const program::Block& block, const kinematics::AxisVector& q) {
  const auto& control = job.machine.control;
  const CompensationDescription& words = job.scene.compensation;
  const Vector3d tip_w = control.tool_in_workpiece(q).translation();
  double off = 0.0;
  for (const auto& [letter, k] : {std::pair{'X', 0}, std::pair{'Y', 1}, std::pair{'Z', 2}})
    off = std::max(
        off, std::abs(block.end[control.find(letter).value()] - tip_w[k]) / words.word_resolution);
  for (const char letter : {'A', 'C'}) {
    const int k = control.find(letter).value();
    off = std::max(off, std::abs(block.end[k] - q[k]) / words.angle_resolution);
  }
  return off;
}

TEST(Compensation, RewrittenNcIsAcceptedAndKeepsToTheCorrectedPointsWithinAWord) {
  const Job job = job_of("gantry_dome.toml", and_more(coarse_raster, {{"part.vertices", "200"}}));
  const Commands ideal = compensate(job, parse_case("perfect-iterated-ideal"));
  const Commands commanded = compensate(job, parse_case("perfect-iterated-program"));
  const program::Path path = program::read_nc(commanded.rewritten_program, "again.ngc",
                                              nc_options(job.scene, job.machine));
  EXPECT_GE(path.motion_blocks, job.path.motion_blocks);
  const auto cuts = [](const program::Block& block) {
    return block.coordinates == program::Coordinates::Tip &&
           block.interpolation == program::Interpolation::Line;
  };
  std::vector<program::Block> rewritten;
  std::copy_if(path.blocks.begin(), path.blocks.end(), std::back_inserter(rewritten), cuts);
  // A block may have been cut up: its end is the one of the next 20 that fits best.
  double worst = 0.0;
  int points = 0;
  std::size_t from = 0;
  for (std::size_t i = 0; i + 1 < ideal.samples.states.size(); ++i) {
    const int at = ideal.samples.block[i];
    if (at == ideal.samples.block[i + 1] || !cuts(job.path.blocks[std::size_t(at)])) continue;
    double best = std::numeric_limits<double>::infinity();
    std::size_t found = from;
    for (std::size_t k = from; k < std::min(from + 20, rewritten.size()); ++k) {
      const double off = words_off(job, rewritten[k], ideal.samples.states[i].q);
      if (off < best) {
        best = off;
        found = k;
      }
    }
    from = found + 1;
    worst = std::max(worst, best);
    ++points;
  }
  std::cout << points << " corrected points in " << rewritten.size() << " blocks: off by at most "
            << worst << " of a word\n";
  EXPECT_GT(points, 1000);
  EXPECT_LE(worst, 0.5 * (1 + 1e-6));
}

TEST(Compensation, RewrittenPvtReadsBackAndFollowsTheIdealChannel) {
  const Job job = job_of("platform_sphere.toml", coarse_spiral);
  const Cut ideal = cut(job, parse_case("perfect-iterated-ideal"));
  const Cut program = cut(job, parse_case("perfect-iterated-program"));
  const program::NcOptions control = nc_options(job.scene, job.machine);
  const program::Path path = program::read_pvt(program.rewritten_program, "again.csv", control);
  const auto rows = program::pvt_rows(path);
  const std::vector<int> columns = {0, 1, 2};
  EXPECT_EQ(program::write_pvt(rows, control.axes, columns), program.rewritten_program);
  EXPECT_GE(rows.size(), job.path.blocks.size());
  const Apart d = apart(program.surface, ideal.surface);
  print_apart(fmt::format("PVT of {} rows", rows.size()), d);
  EXPECT_EQ(d.unlike, 0);
  EXPECT_LT(d.rms, 1.0_nm);  // its words are not rounded
}

// What the perfect belief promises, held on every packaged scene and variant: the error-free map
// comes back, or what is left is what the axes cannot mend. That part is computed here from poses
// alone: at the instant that cuts a vertex, how far the edge of the tool that is left over stands
// from the nominal one, along the normal.

/// Scenes and variants whose truth is not deterministic or whose axes cannot mend it. The platform
/// has no axis that moves along Y and none that turns the tool, and its spindle has a random part;
/// the lathe has no axis along which its turret is pressed down; a tool of another radius has no
/// place where it makes the same part. Everywhere else the map comes back.
const std::set<std::string> beyond_correction = {"platform_calibration",
                                                 "platform_cone",
                                                 "platform_cone, two numbers inferred",
                                                 "platform_plane",
                                                 "platform_plane, two numbers inferred",
                                                 "platform_sphere",
                                                 "platform_sphere, two numbers inferred",
                                                 "cone_shaft",
                                                 "shaft_training",
                                                 "stepped_shaft",
                                                 "on_machine_measurement, worn ball"};

/// Fewer vertices and, where a program is generated, longer steps: the machine is the scene's own.
std::vector<Override> coarse_changes(const Scene& scene) {
  std::vector<Override> changes;
  if (!std::holds_alternative<MeshFile>(scene.part.shape))
    changes.push_back({"part.vertices", "1500"});
  if (std::holds_alternative<program::Raster>(scene.program.source)) {
    changes.push_back({"program.step_over_mm", "2.0"});
    changes.push_back({"program.step_mm", "2.0"});
  }
  if (std::holds_alternative<program::Raster>(scene.program.source) && scene.cutting) {
    changes.push_back({"cutting.spacing_mm", "1.0"});
    changes.push_back({"cutting.step_mm", "1.0"});
  }
  if (std::holds_alternative<program::Flank>(scene.program.source))
    changes.push_back({"program.step_mm", "1.0"});
  if (std::holds_alternative<program::Spiral>(scene.program.source))
    changes.push_back({"program.feed_um_per_rev", "60"});
  return changes;
}

/// Whether a variant cuts with another truth, and not only believes or reads otherwise.
bool cuts_otherwise(const Variant& variant) {
  return std::any_of(variant.set.begin(), variant.set.end(), [](const Override& one) {
    return one.path.rfind("belief", 0) != 0 && one.path.rfind("compare", 0) != 0 &&
           one.path.rfind("signals", 0) != 0;
  });
}

/// Whether a variant is also one of gantry_warmup, with the same part, program and heat.
bool is_in_another_scene(const std::string& scene, const Variant& variant) {
  return scene == "gantry_warmup_days" &&
         (variant.name == "cold" || variant.name == "30 min" || variant.name == "3 h");
}

// --- the tools, once more

/// How far a point lies outside a tool, and along which outward normal.
struct Outside {
  double distance;
  Vector3d normal;
};

Outside outside(const cutting::Cutter& cutter, const Vector3d& p_t) {
  const double radius = std::hypot(p_t.x(), p_t.y());
  const Vector3d around(p_t.x() / std::max(radius, 1e-9), p_t.y() / std::max(radius, 1e-9), 0.0);
  const double out = radius - (cutter.radius - cutter.corner_radius);
  const double down = cutter.corner_radius - p_t.z();
  if (out > 0.0 && down > 0.0) {
    const double far = std::hypot(out, down);
    return {far - cutter.corner_radius, (out * around - down * Vector3d::UnitZ()) / far};
  }
  if (out > down) return {out - cutter.corner_radius, around};
  return {down - cutter.corner_radius, -Vector3d::UnitZ()};
}

Outside outside(const cutting::Nose& nose, const Vector3d& p_t) {
  const double far = std::hypot(p_t.x(), p_t.z()), psi = std::atan2(p_t.z(), p_t.x());
  double radius = nose.radius;
  for (const cutting::NoseWave& wave : nose.waves)
    radius += wave.amplitude * std::cos(wave.order * psi + wave.phase);
  return {far - radius, Vector3d(p_t.x(), 0.0, p_t.z()) / far};
}

// --- the machine at an instant

/// Last sample before an instant, and how far the instant is on the way to the next.
struct Instant {
  std::size_t before;
  double fraction;
};
Instant between(const std::vector<AxisState>& states, double time_s) {
  const auto after =
      std::lower_bound(states.begin() + 1, states.end() - 1, time_s,
                       [](const AxisState& state, double time) { return state.time_s < time; });
  const AxisState& before = *(after - 1);
  const double step = after->time_s - before.time_s;
  return {std::size_t(after - states.begin()) - 1,
          step > 0.0 ? std::clamp((time_s - before.time_s) / step, 0.0, 1.0) : 1.0};
}

/// Where a milling tool is between two poses: its tip on a line, its axis on a great circle.
Pose on_the_way(const Pose& from, const Pose& to, double fraction) {
  const Vector3d u = from.linear().col(2), v = to.linear().col(2);
  const Eigen::AngleAxisd turn(kinematics::rotation_between(u, v));
  Pose T = from;
  T.linear() = Eigen::AngleAxisd(fraction * turn.angle(), turn.axis()) * from.linear();
  T.translation() += fraction * (to.translation() - from.translation());
  return T;
}

/// A tool on its way: where it is, and what it is.
struct MovingTool {
  std::function<Pose(double time_s)> T_wt;
  const std::variant<cutting::Cutter, cutting::Nose>& shape;
  bool turning;  ///< a point is made when the rake plane of the tool passes it
};

/// Instant near the given one at which the rake plane passes a point; none where it does not.
std::optional<double> passing(const MovingTool& tool, const Vector3d& p_w, double time_s) {
  constexpr double step = 1e-5;  // s
  const auto height = [&](double t) { return (tool.T_wt(t).inverse() * p_w).y(); };
  double t = time_s;
  for (int i = 0; i < 6; ++i) {
    const double y = height(t);
    if (std::abs(y) < 1e-7) return t;
    const double speed = (height(t + step) - height(t - step)) / (2 * step);
    t -= y / speed;
    if (!(std::abs(t - time_s) < 0.02)) return std::nullopt;
  }
  return std::nullopt;
}

/// A vertex and its outward normal.
struct Ray {
  Vector3d p_w;
  Vector3d n;
};

/// Where a ray leaves a tool near an instant, mm along the normal from a first guess; none where
/// that side of the tool does not look at the part.
std::optional<double> reach(const MovingTool& tool, const Ray& ray, double time_s, double s) {
  for (int i = 0; i < 5; ++i) {
    const Vector3d p_w = ray.p_w + s * ray.n;
    const std::optional<double> t = tool.turning ? passing(tool, p_w, time_s) : time_s;
    if (!t) return std::nullopt;
    const Pose T_wt = tool.T_wt(*t);
    const Vector3d p_t = T_wt.inverse() * p_w;
    const Outside at =
        std::visit([&](const auto& shape) { return outside(shape, p_t); }, tool.shape);
    const double towards = -(T_wt.linear() * at.normal).dot(ray.n);
    if (towards < 0.1) return std::nullopt;
    s += at.distance / towards;
    if (std::abs(at.distance) < 1e-9) break;
  }
  return s;
}

/// One compensated cut beside the error-free one.
struct Kept {
  explicit Kept(const Scene& scene);

  /// Where the tool is really while the compensated program runs, at a sample or at an instant.
  Pose actual(std::size_t sample) const;
  Pose actual(double time_s) const;
  /// The same of the tool as it should be.
  Pose nominal(double time_s) const;
  bool turning() const { return std::holds_alternative<cutting::Nose>(job.scene.tool.actual); }

  Job job;
  Commands commanded;
  Cut error_free, compensated_commands;
  std::vector<AxisVector> acceleration;
};

Kept::Kept(const Scene& scene)
    : job(prepare(scene)),
      commanded(compensate(job, parse_case("perfect-iterated-ideal"))),
      error_free(cut_error_free(job)),
      compensated_commands(cut(job, commanded)) {
  if (!job.accelerations.empty()) acceleration = accelerations(commanded.samples);
}

/// Axes between two samples.
AxisState state_at(const std::vector<AxisState>& states, const Instant& at) {
  AxisState state = states[at.before + 1];
  const AxisState& before = states[at.before];
  state.q = before.q + at.fraction * (state.q - before.q);
  state.time_s = before.time_s + at.fraction * (state.time_s - before.time_s);
  return state;
}

Pose Kept::actual(std::size_t sample) const {
  const AxisState& state = commanded.samples.states[sample];
  errors::Load load = load_at(compensated_commands.process, state.time_s);
  if (!acceleration.empty()) load.acceleration = acceleration[sample];
  return tool_in_workpiece(job.truth, state, load);
}

Pose Kept::actual(double time_s) const {
  const Instant at = between(commanded.samples.states, time_s);
  if (!turning()) return on_the_way(actual(at.before), actual(at.before + 1), at.fraction);
  const AxisState state = state_at(commanded.samples.states, at);
  return tool_in_workpiece(job.truth, state, load_at(compensated_commands.process, state.time_s));
}

Pose Kept::nominal(double time_s) const {
  const Instant at = between(job.samples.states, time_s);
  if (!turning())
    return on_the_way(job.T_wt_nominal[at.before], job.T_wt_nominal[at.before + 1], at.fraction);
  return job.machine.nominal.tool_in_workpiece(state_at(job.samples.states, at).q);
}

/// Root mean squares over the vertices, mm.
struct Balance {
  double left = 0.0;       ///< compensated less error-free map
  double projected = 0.0;  ///< the same from poses alone, each map at its own instant
  double rest = 0.0;       ///< one less the other
  double beyond = 0.0;     ///< of what is left outside what its two passes say, each on its own
  int vertices = 0;
  int unknown = 0;  ///< vertices of which poses say nothing
  int unlike = 0;   ///< cut in one map only
};

/// The pass that wins on the error-free machine need not win again: what is left lies between what
/// the tool that is left over changes in one and in the other.
Balance balance(const Kept& kept) {
  Balance sum;
  const MovingTool wanted{[&](double t) { return kept.nominal(t); }, kept.job.scene.tool.nominal,
                          kept.turning()};
  const MovingTool real{[&](double t) { return kept.actual(t); }, kept.job.scene.tool.actual,
                        kept.turning()};
  const cutting::Surface &free = kept.error_free.surface,
                         &compensated_commands = kept.compensated_commands.surface;
  for (std::size_t i = 0; i < free.status.size(); ++i) {
    const Index k = Index(i);
    const bool in_free = free.status[i] == cutting::VertexStatus::Cut;
    const bool in_compensated = compensated_commands.status[i] == cutting::VertexStatus::Cut;
    if (in_free != in_compensated) ++sum.unlike;
    if (!in_free || !in_compensated) continue;
    const Ray ray{kept.job.design_w.vertices.row(k), kept.job.design_w.normals.row(k)};
    const double t_free = free.cut_time_s[k], t_compensated = compensated_commands.cut_time_s[k];
    const double left = compensated_commands.residual[k] - free.residual[k];
    sum.left += left * left;
    ++sum.vertices;
    const auto should = reach(wanted, ray, t_free, free.residual[k]);
    const auto is = reach(real, ray, t_compensated, free.residual[k]);
    const auto should_now = reach(wanted, ray, t_compensated, free.residual[k]);
    const auto was = reach(real, ray, t_free, free.residual[k]);
    if (!should || !is || !should_now || !was) {
      ++sum.unknown;
      continue;
    }
    const auto [least, most] = std::minmax({*is - *should_now, *was - *should});
    const double projected = *is - *should, beyond = left - std::clamp(left, least, most);
    sum.projected += projected * projected;
    sum.rest += (left - projected) * (left - projected);
    sum.beyond += beyond * beyond;
  }
  const auto root = [](double squares, int n) { return std::sqrt(squares / std::max(1, n)); };
  const int known = sum.vertices - sum.unknown;
  return {root(sum.left, sum.vertices),
          root(sum.projected, known),
          root(sum.rest, known),
          root(sum.beyond, known),
          sum.vertices,
          sum.unknown,
          sum.unlike};
}

/// Root mean square of what is known of the point that a compensator restores and lies along a
/// slide that could mend it, mm; of the slide with most.
double left_along_slides(const Kept& kept) {
  PredictedRun run{{}, kept.acceleration};
  run.process.steps = kept.compensated_commands.process.steps;
  const compensation::Belief belief = perfect_belief(kept.job, std::move(run));
  const kinematics::Chain& chain = kept.job.machine.nominal;
  const auto* cutter = std::get_if<cutting::Cutter>(&kept.job.scene.tool.nominal);
  const Vector3d point_t(0, 0, cutter ? cutter->corner_radius : 0.0);
  VectorXd sum = VectorXd::Zero(chain.size());
  double count = 0.0;
  for (std::size_t i = 0; i < kept.commanded.samples.states.size(); i += 7) {
    const AxisState& state = kept.commanded.samples.states[i];
    const Vector3d off_w = belief(state) * point_t - kept.job.T_wt_nominal[i] * point_t;
    const auto J = kinematics::axis_jacobian(chain, state.q);
    for (int k = 0; k < chain.size(); ++k)
      if (chain.joints()[std::size_t(k)].motion == kinematics::Motion::Linear)
        sum[k] += std::pow(J.col(k).head<3>().dot(off_w), 2);
    count += 1.0;
  }
  return std::sqrt(sum.maxCoeff() / count);
}

class PerfectBelief : public testing::TestWithParam<std::string> {};

void hold(const std::string& name, const Scene& scene) {
  SCOPED_TRACE(name);
  const Kept kept(scene);
  const Balance b = balance(kept);
  const double slides = left_along_slides(kept);
  std::cout << fmt::format(
      "{:<34} left {:9.4f} nm  projected {:9.4f}  rest {:7.4f}  beyond both passes {:7.4f}  along "
      "slides {:.1e} nm  vertices {} (unknown {})\n",
      name, b.left / units::nm, b.projected / units::nm, b.rest / units::nm, b.beyond / units::nm,
      slides / units::nm, b.vertices, b.unknown);
  EXPECT_GT(b.vertices, 500);
  // a tool that is left beside the spindle axis may miss the vertex on it
  EXPECT_LE(b.unlike, kept.turning() ? 1 : 0);
  EXPECT_LE(b.unknown, b.vertices / 20);  // the edge of a flat end has no normal
  if (beyond_correction.count(name) == 0)
    EXPECT_LT(b.left, 1.0_nm);
  else
    EXPECT_GT(b.left, 1.0_nm) << "it can be compensated after all";
  EXPECT_LT(b.rest, 1.0_nm);
  EXPECT_LT(b.beyond, 1.0_nm);
  // where the cut bends, the belief goes by the load of the run before, which jumps elsewhere where
  // the tool enters; the map holds for that
  if (kept.compensated_commands.process.steps.empty()) {
    EXPECT_LT(slides, kept.acceleration.empty() ? 0.02_nm : 1.0_nm);
  }
}

TEST_P(PerfectBelief, LeavesTheErrorFreeMapOrWhatTheAxesCannotCorrect) {
  const auto file = packaged(GetParam());
  const Scene scene = read_scene(file);
  const std::vector<Override> small = coarse_changes(scene);
  const std::string stem = file.stem().string();
  hold(stem, read_scene(file, small));
  for (const Variant& variant : scene.variants) {
    if (!cuts_otherwise(variant)) continue;
    if (is_in_another_scene(stem, variant) && std::getenv("ABBE_LONG") == nullptr) continue;
    std::vector<Override> changes = small;
    changes.insert(changes.end(), variant.set.begin(), variant.set.end());
    hold(stem + ", " + variant.name, read_scene(file, changes));
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, PerfectBelief, testing::ValuesIn(packaged_scenes()),
                         [](const auto& scene) {
                           return scene.param.substr(0, scene.param.find('.'));
                         });

}  // namespace
}  // namespace abbe::sim
