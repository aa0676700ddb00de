// Channels as they show on the part: what each leaves of a perfect belief, against its formula.

#include "cutting/map/residual.h"
#include "errors/geometric.h"
#include "sim/compensation/channels.h"
#include "sim/cut/commands.h"
#include "sim/loop/compensate.h"
#include "sim/loop/correctors.h"
#include "sim/scene/read_scene.h"
#include "tests/compensation/encoder_signals.h"
#include "tests/sim/signal_columns.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

constexpr double flat_feed = 50.0;  // mm/s, along X on the flat

/// A flat under a ball end mill, passes along its own x far enough apart that each vertex has one.
/// @param more  TOML sections, the errors first
BallRaster turned_flat(const std::string& turn_deg, const std::string& more) {
  return {fmt::format("surface = \"rectangle\"\nlength_x_mm = 40\nlength_y_mm = 8\n"
                      "at_mm = [0, 0, 80]\nturn_deg = {}\nvertices = 3000\n",
                      turn_deg),
          1.0,
          1.0,
          0.0,
          "gantry_cxyza",
          more};
}

Job job_of_flat(const std::string& turn_deg, const std::string& more,
                const std::vector<Override>& changes = {}) {
  std::vector<Override> all = {{"program.feed_mm_per_min", "3000"}, {"program.overrun_mm", "20"}};
  all.insert(all.end(), changes.begin(), changes.end());
  return job_of(turned_flat(turn_deg, more), all);
}

/// Straightness that lifts the tool by so many um for every mm of X.
std::string lift(double um_per_mm) {
  return fmt::format(
      "[errors.EZX]\nkind = \"polynomial\"\ncoefficients_um = [0, {}]\nhalf_range_mm = 100\n",
      100 * um_per_mm);
}

/// Map of a case less that of the ideal channel, vertex by vertex, NaN where either is uncut.
struct BeyondIdeal {
  VectorXd by;      ///< (vertices) mm
  VectorXd time_s;  ///< (vertices) of the cut
  Cut cut;

  double mean() const {
    double sum = 0.0;
    for (const double one : by) sum += std::isnan(one) ? 0.0 : one;
    return sum / count();
  }
  double rms() const {
    double sum = 0.0;
    for (const double one : by) sum += std::isnan(one) ? 0.0 : one * one;
    return std::sqrt(sum / count());
  }
  double most() const {
    double most = 0.0;
    for (const double one : by)
      if (!std::isnan(one)) most = std::max(most, std::abs(one));
    return most;
  }
  double count() const {
    return double(std::count_if(by.begin(), by.end(), [](double one) { return !std::isnan(one); }));
  }
};

BeyondIdeal beyond_ideal(const Job& job, const std::string& name, const cutting::Surface& ideal) {
  BeyondIdeal left{{}, {}, cut(job, parse_case(name))};
  left.by = cutting::minus(left.cut.surface, ideal).residual;
  for (Index i = 0; i < left.by.size(); ++i)
    if (left.cut.surface.status[std::size_t(i)] != cutting::VertexStatus::Cut ||
        ideal.status[std::size_t(i)] != cutting::VertexStatus::Cut)
      left.by[i] = std::numeric_limits<double>::quiet_NaN();
  left.time_s = left.cut.surface.cut_time_s;
  EXPECT_GT(left.count(), 2000);
  return left;
}

cutting::Surface ideal_map(const Job& job) {
  return cut(job, parse_case("perfect-position-ideal")).surface;
}

/// Components of a direction of the part along its three slides, by the machine's own motion.
Vector3d by_axis(const Job& job, const Vector3d& direction_w) {
  const kinematics::Chain& chain = job.machine.nominal;
  const kinematics::AxisVector q = job.samples.states[job.samples.states.size() / 2].q;
  Vector3d result;
  for (int k = 0; k < 3; ++k) {
    kinematics::AxisVector moved = q;
    moved[chain.find("XYZ"[k]).value()] += 1.0;
    result[k] = direction_w.dot(chain.tool_in_workpiece(moved).translation() -
                                chain.tool_in_workpiece(q).translation());
  }
  return result;
}

Vector3d normal_by_axis(const Job& job) {
  return by_axis(job, job.design_w.normals.row(0).transpose());
}

/// What a ball takes off the mean of a saw tooth that falls by `step` every `length` of the feed,
/// mm: where the tool drops it cuts back into what it left, as far as sqrt(2 R step).
double taken_by_the_ball(double step, double length) {
  constexpr double R = 5.0;
  return 2.0 / 3.0 * step * std::sqrt(2 * R * step) / length;
}

void print_ratio(const std::string& what, double measured, double formula) {
  std::cout << fmt::format("{}: {:.4f} nm, by its formula {:.4f} nm, ratio {:.4f}\n", what,
                           measured / units::nm, formula / units::nm, measured / formula);
}

// --- pulses

constexpr double quantum = 0.25e-3;  // mm

/// Three errors along X, seen on a flat that leans in two directions, so that all slides move.
Job leaning_flat() {
  return job_of_flat(
      "[25, -35, 20]",
      "[errors]\nEXX = { kind = \"polynomial\", coefficients_um = [0, 21], half_range_mm = 100 }\n"
      "EYX = { kind = \"polynomial\", coefficients_um = [0, -24], half_range_mm = 100 }\n"
      "EZX = { kind = \"polynomial\", coefficients_um = [0, 29], half_range_mm = 100 }\n"
      "[compensation.pulses]\ncount_um = 0.25\ncycle_ms = 1\n",
      // a pair of 2 us must pass while a quarter of a count does
      {{"machine", "\"" + packaged("machines/three_axis_table.toml").string() + "\""},
       {"program.feed_mm_per_min", "600"}});
}

/// Counts over which the correction of each slide runs while the flat is cut.
Vector3d counts_run(const Job& job, const BeyondIdeal& left) {
  const auto signals = columns(left.cut.signals);
  const VectorXd& time_s = signals.at("time_s");
  Vector3d run;
  for (int k = 0; k < 3; ++k) {
    const VectorXd& correction = signals.at(fmt::format("{}_correction_um", "XYZ"[k]));
    double least = 1e9, most = -1e9;
    for (Index i = 0; i < time_s.size(); ++i) {
      if (time_s[i] < left.time_s.minCoeff() || time_s[i] > left.time_s.maxCoeff()) continue;
      least = std::min(least, correction[i]);
      most = std::max(most, correction[i]);
    }
    run[k] = (most - least) * units::um / job.scene.compensation.pulses.count;
  }
  return run;
}

TEST(ChannelScenes, PulsesLeaveTheQuantumOfTheirCount) {
  Job job = leaning_flat();
  const cutting::Surface ideal = ideal_map(job);
  const Vector3d n = normal_by_axis(job);
  EXPECT_NEAR(n.norm(), 1.0, 1e-9);
  const double formula = n.norm() * quantum / std::sqrt(12.0);
  double sum = 0.0, squares = 0.0, least = 1.0, most = 0.0;
  const int phases = 20;
  for (int seed = 1; seed <= phases; ++seed) {
    job.scene.seed = std::uint64_t(seed);
    const BeyondIdeal left = beyond_ideal(job, "perfect-position-pulses", ideal);
    const double rms = left.rms();
    sum += rms;
    squares += rms * rms;
    least = std::min(least, rms);
    most = std::max(most, rms);
    if (seed > 1) continue;
    const Vector3d run = counts_run(job, left);
    std::cout << "normal along X, Y, Z: " << n.transpose() << "; the correction runs over "
              << run.transpose() << " counts\n";
    EXPECT_GE(run.minCoeff(), 20.0);
  }
  print_ratio("quantum of 0.25 um, mean of 20 phases", sum / phases, formula);
  print_ratio("  root of the mean square", std::sqrt(squares / phases), formula);
  std::cout << "  single phases " << least / formula << " .. " << most / formula << "\n";
  EXPECT_NEAR(sum / phases / formula, 1.0, 0.1);
  EXPECT_NEAR(std::sqrt(squares / phases) / formula, 1.0, 0.1);
  EXPECT_LT(least, most) << "the phase counts";
}

TEST(ChannelScenes, PulsesLeaveAnAxisAloneOfWhichNothingIsWanted) {
  const Job job = job_of_flat("[0, 0, 0]", lift(0.1) + "[compensation.pulses]\ncount_um = 0.25\n");
  const Cut made = cut(job, parse_case("perfect-position-pulses"));
  const auto signals = columns(made.signals);
  for (const char* column :
       {"X_correction_um", "Y_correction_um", "C_correction_urad", "A_correction_urad"})
    EXPECT_TRUE(signals.at(column).isZero(0.0)) << column;
  EXPECT_GT(signals.at("Z_correction_um").cwiseAbs().maxCoeff(), 1.0);
}

// --- open control and the position loop

TEST(ChannelScenes, APositionLoopLagsByTheSlopeOverItsBandwidth) {
  const double um_per_mm = 0.1, slope = flat_feed * um_per_mm * units::um;  // mm/s
  const auto mean_left = [&](double rises, const std::string& loop) {
    const Job job =
        job_of_flat("[0, 0, 0]", lift(rises) + "[compensation.open]\ncycle_ms = 2\n" + loop);
    return beyond_ideal(job, "perfect-position-open", ideal_map(job)).mean();
  };
  const double w = 2 * pi * 10.0, half_cycle = 1e-3;
  const std::string first = "[compensation.loop]\norder = \"first\"\nbandwidth_Hz = 10\n";
  const std::string second =
      "[compensation.loop]\norder = \"second\"\nbandwidth_Hz = 10\ndamping = 0.7\n";
  const double held = mean_left(um_per_mm, "");
  const double bare =
      slope * half_cycle - taken_by_the_ball(2 * slope * half_cycle, 2 * flat_feed * half_cycle);
  print_ratio("open control of 2 ms, no loop", held, bare);
  const double lag1 = mean_left(um_per_mm, first);
  print_ratio("first-order loop of 10 Hz", lag1, slope * (1 / w + half_cycle));
  const double lag2 = mean_left(um_per_mm, second);
  print_ratio("second-order loop of 10 Hz, damping 0.7", lag2, slope * (1.4 / w + half_cycle));
  const double down = mean_left(-um_per_mm, first);
  print_ratio("first-order loop, the tool sinks", down, -slope * (1 / w + half_cycle));
  // the tool rises along the feed and the correction that lowers it comes late: material is left
  EXPECT_NEAR(held, bare, 0.1_nm);
  EXPECT_NEAR(lag1 / (slope * (1 / w + half_cycle)), 1.0, 0.01);
  EXPECT_NEAR(lag2 / (slope * (1.4 / w + half_cycle)), 1.0, 0.01);
  EXPECT_NEAR(down / (-slope * (1 / w + half_cycle)), 1.0, 0.01);
}

// --- origin shift

TEST(ChannelScenes, OriginShiftLeavesWhatItsCycleAndDelayMiss) {
  const double um_per_mm = 0.1037, slope = flat_feed * um_per_mm * units::um;
  struct Setting {
    double T, D, increment;
  };
  for (const Setting& s : {Setting{0.1, 0.0, 0.0}, Setting{0.1, 0.05, 0.0}, Setting{0.02, 0.1, 0.0},
                           Setting{0.1, 0.05, 0.2e-3}, Setting{0.01, 0.01, 0.2e-3}}) {
    const Job job = job_of_flat(
        "[0, 0, 0]", lift(um_per_mm) + fmt::format("[compensation.origin]\ncycle_ms = {}\n"
                                                   "delay_ms = {}\nincrement_um = {}\n",
                                                   1e3 * s.T, 1e3 * s.D, s.increment / units::um));
    const BeyondIdeal left = beyond_ideal(job, "perfect-position-origin", ideal_map(job));
    const double lag = slope * std::sqrt(s.T * s.T / 3 + s.T * s.D + s.D * s.D);
    const double formula = std::hypot(lag, s.increment / std::sqrt(12.0));
    print_ratio(fmt::format("origin shift, cycle {} ms, delay {} ms, increment {} um, RMS",
                            1e3 * s.T, 1e3 * s.D, s.increment / units::um),
                left.rms(), formula);
    const double step = std::max(slope * s.T, s.increment);
    const double mean = slope * (s.T / 2 + s.D) - taken_by_the_ball(step, step / um_per_mm / 1e-3);
    print_ratio("  mean", left.mean(), mean);
    EXPECT_NEAR(left.rms() / formula, 1.0, 0.05);
    EXPECT_NEAR(left.mean() / mean, 1.0, 0.03);
  }
}

// --- tables

TEST(ChannelScenes, ATableLeavesNoMoreThanAnEighthOfSpacingSquaredTimesCurvature) {
  struct Curve {
    const char* what;
    std::string toml;
    double bend;  ///< 1/mm, largest second derivative
  };
  const double turn = 2 * pi / 90.0;
  const Curve curves[] = {
      {"parabola",
       "[errors.EZX]\nkind = \"polynomial\"\ncoefficients_um = [0, 3, 20]\nhalf_range_mm = 100\n",
       2 * 20.0_um / (100.0 * 100.0)},
      {"wave", "[errors.EZX]\nkind = \"fourier\"\nperiod_mm = 90\na_um = [6]\n",
       6.0_um * turn * turn}};
  for (const Curve& curve : curves) {
    double last = 0.0;
    for (const double h : {10.0, 5.0, 2.5}) {
      const Job job = job_of_flat(
          "[0, 0, 0]",
          curve.toml +
              fmt::format("[compensation.table]\nspacing_mm = {}\nmost_points = 1000\n", h));
      const BeyondIdeal left = beyond_ideal(job, "perfect-position-table", ideal_map(job));
      const double bound = h * h / 8 * curve.bend;
      print_ratio(fmt::format("table of {} mm, {}", h, curve.what), left.most(), bound);
      EXPECT_LE(left.most(), bound + 0.01_nm);
      EXPECT_GE(left.most(), 0.8 * bound) << "somewhere it comes near";
      if (last > 0.0) {
        EXPECT_NEAR(last / left.most(), 4.0, 0.7);
      }
      last = left.most();
    }
  }
}

// --- piezo

TEST(ChannelScenes, APiezoStopsAtTheEndOfItsStroke) {
  const double um_per_mm = 0.1;
  const Job job =
      job_of_flat("[0, 0, 0]", lift(um_per_mm) +
                                   "[compensation.piezo]\nrange_um = 2\ncycle_ms = 0.2\n"
                                   "stiffness_N_per_um = 50\n");
  const BeyondIdeal left = beyond_ideal(job, "perfect-position-piezo", ideal_map(job));
  const VectorXd stroke = columns(left.cut.signals).at("piezo_um");
  double worst = 0.0, beyond = 0.0;
  for (Index i = 0; i < left.by.size(); ++i) {
    if (std::isnan(left.by[i])) continue;
    const Vector3d p_w = job.design_w.vertices.row(i).transpose();
    const double wanted = -um_per_mm * p_w.x() * units::um;
    const double expected = std::clamp(wanted, -1.0_um, 1.0_um) - wanted;
    if (std::abs(std::abs(wanted) - 1.0_um) < 0.1_um) continue;  // it has yet to settle
    worst = std::max(worst, std::abs(left.by[i] - expected));
    beyond = std::max(beyond, std::abs(expected));
  }
  std::cout << "piezo of 2 um: up to " << beyond / units::um << " um beyond it, known to "
            << worst / units::nm << " nm; stroke " << stroke.minCoeff() << " .. "
            << stroke.maxCoeff() << " um\n";
  EXPECT_GT(beyond, 0.8_um);
  // in its range it lags, 2 d / w and half a cycle late
  const double lag = flat_feed * um_per_mm * units::um * (1.4 / (2 * pi * 100.0) + 0.1e-3);
  std::cout << "  its lag by the formula " << lag / units::nm << " nm\n";
  EXPECT_LT(worst, 1.2 * lag);
  EXPECT_NEAR(stroke.minCoeff(), -1.0, 0.1);
  EXPECT_NEAR(stroke.maxCoeff(), 1.0, 0.1);
}

TEST(ChannelScenes, APiezoYieldsUnderTheForceOfTheCut) {
  const auto made = [](double stiffness) {
    return job_of_flat(
        "[0, 0, 0]",
        fmt::format(
            "{}[cutting]\nblank = \"offset\"\nallowance_mm = 0.3\nfloor_mm = -5\nspacing_mm = 0.5\n"
            "flutes = 2\n"
            "[compensation.piezo]\nrange_um = 100\nstiffness_N_per_um = {}\n",
            lift(0.1), stiffness),
        {{"material", "\"" + packaged("materials/al6082_t6_carbide.toml").string() + "\""},
         {"program.speed_rpm", "12000"}});
  };
  const Job stiff = made(1e9), soft = made(20.0);
  const Cut rigid = cut(stiff, parse_case("perfect-position-piezo"));
  const BeyondIdeal left = beyond_ideal(soft, "perfect-position-piezo", rigid.surface);
  double worst = 0.0, most = 0.0, sum = 0.0;
  for (Index i = 0; i < left.by.size(); ++i) {
    if (std::isnan(left.by[i])) continue;
    const double force = load_at(left.cut.process, left.time_s[i]).tool_wrench_t.z();
    most = std::max(most, std::abs(force / 20e3));
    sum += force / 20e3;
    worst = std::max(worst, std::abs(left.by[i] - force / 20e3));
  }
  std::cout << "yields by up to " << most / units::um << " um, mean "
            << sum / left.count() / units::um << " um (map " << left.mean() / units::um
            << " um), known to " << worst / units::nm << " nm\n";
  EXPECT_GT(most, 0.2_um);
  EXPECT_NEAR(left.mean(), sum / left.count(), 0.02 * most);
}

// --- the packaged scene

/// What the axes are commanded beyond the program along a direction of the slides, (samples) mm.
VectorXd along(const Job& job, const Vector3d& direction,
               const std::vector<kinematics::AxisState>& corrected) {
  const auto commanded = uncompensated_commands(job).samples.states;
  VectorXd result(Index(corrected.size()));
  for (std::size_t i = 0; i < corrected.size(); ++i) {
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
      const int joint = job.machine.control.find("XYZ"[k]).value();
      sum += direction[k] * (corrected[i].q[joint] - commanded[i].q[joint]);
    }
    result[Index(i)] = sum;
  }
  return result;
}

/// Root mean square over the vertices of a value and of its rate, at the instants of their cut.
struct OnThePart {
  double value = 0.0;
  double rate = 0.0;
};
OnThePart on_the_part(const Job& job, const VectorXd& of_sample, const BeyondIdeal& left) {
  const auto& states = job.samples.states;
  OnThePart part;
  for (Index v = 0; v < left.by.size(); ++v) {
    if (std::isnan(left.by[v])) continue;
    const auto after = std::lower_bound(
        states.begin() + 1, states.end() - 1, left.time_s[v],
        [](const kinematics::AxisState& state, double time_s) { return state.time_s < time_s; });
    const Index i = after - states.begin();
    const double rate = (of_sample[i] - of_sample[i - 1]) / (after->time_s - (after - 1)->time_s);
    const double value = of_sample[i] + rate * (left.time_s[v] - after->time_s);
    part.value += value * value;
    part.rate += rate * rate;
  }
  return {std::sqrt(part.value / left.count()), std::sqrt(part.rate / left.count())};
}

/// Sum over the axes of h^2/8 max|second derivative| of the correction along the normal, near where
/// the program goes, the other axes in its middle.
double spacing_bound(const Job& job, const Vector3d& n) {
  const Corrector corrector = learn_correction(job, parse_case("perfect-position-table")).corrector;
  kinematics::AxisVector low = job.samples.states.front().q, high = low;
  for (const kinematics::AxisState& state : job.samples.states) {
    low = low.cwiseMin(state.q);
    high = high.cwiseMax(state.q);
  }
  double bound = 0.0;
  for (int axis = 0; axis < low.size(); ++axis) {
    const VectorXd positions = compensation::table_positions(job.machine.control, axis,
                                                             job.scene.compensation.table.options);
    if (positions.size() < 2) continue;
    const double h = positions[1] - positions[0], step = h / 16;
    const Index points = Index((high[axis] - low[axis] + 2 * h) / step) + 1;
    VectorXd value(points);
    for (Index i = 0; i < points; ++i) {
      kinematics::AxisState state = job.samples.states.front();
      state.q = 0.5 * (low + high);
      state.q[axis] = low[axis] - h + double(i) * step;
      const auto corrected =
          corrector({state}, {job.machine.nominal.tool_in_workpiece(state.q)}).states.front();
      value[i] = 0.0;
      for (int k = 0; k < 3; ++k) {
        const int slide = job.machine.control.find("XYZ"[k]).value();
        value[i] += n[k] * (corrected.q[slide] - state.q[slide]);
      }
    }
    const VectorXd bend =
        (value.head(points - 2) - 2 * value.segment(1, points - 2) + value.tail(points - 2)) /
        (step * step);
    const double of_axis = h * h / 8 * bend.cwiseAbs().maxCoeff();
    std::cout << "  table of " << job.machine.control.joints()[std::size_t(axis)].name << ": "
              << positions.size() << " points, " << h << " mm or rad apart, at most "
              << of_axis / units::nm << " nm\n";
    bound += of_axis;
  }
  return bound;
}

TEST(ChannelScenes, EachChannelOfThePackagedSceneLeavesWhatItsFormulaSays) {
  const Job job = job_of("gantry_channels.toml", {{"part.vertices", "2500"}});
  const CompensationDescription& limits = job.scene.compensation;
  const cutting::Surface ideal = ideal_map(job);
  const Vector3d n = normal_by_axis(job);
  const auto corrected = compensate(job, parse_case("perfect-position-ideal")).samples.states;
  const VectorXd wanted = along(job, n, corrected);
  const double normal = n.norm();
  const auto late = [](const compensation::PositionLoop& loop) {
    return 2 * loop.damping / (2 * pi * loop.bandwidth);
  };
  const auto missed = [](double T, double D) { return std::sqrt(T * T / 3 + T * D + D * D); };
  const double lag = late(limits.loop);
  const auto held = [&](const char* channel, double measured, double formula, double within) {
    print_ratio(channel, measured, formula);
    EXPECT_NEAR(measured / formula, 1.0, within) << channel;
  };
  const auto left = [&](const char* channel) {
    return beyond_ideal(job, std::string("perfect-position-") + channel, ideal);
  };

  const BeyondIdeal pulses = left("pulses");
  const double rate = on_the_part(job, wanted, pulses).rate;
  std::cout << "normal " << n.transpose() << ", what is wanted along it changes by "
            << rate / units::um << " um/s RMS\n";
  held("pulses", pulses.rms(),
       std::hypot(normal * limits.pulses.count / std::sqrt(12.0),
                  rate * missed(limits.pulses.cycle_s, lag)),
       0.1);
  held("open", left("open").rms(), rate * missed(limits.open.cycle_s, limits.open.delay_s + lag),
       0.1);
  held("origin", left("origin").rms(),
       std::hypot(normal * limits.origin.increment / std::sqrt(12.0),
                  rate * missed(limits.origin.cycle_s, limits.origin.delay_s + lag)),
       0.15);
  // a block joins two rounded ends: on average over it 2/3 of their variance is left
  held("program", left("program").rms(), normal * limits.word_resolution / std::sqrt(18.0), 0.15);
  // a piezo leaves the passes where they are, aside: there the cusps slope by y / R of their middle
  const BeyondIdeal piezo = left("piezo");
  const Vector3d aside = by_axis(job, job.scene.part.T_wm.linear().col(1));
  const double slope =
      std::get<program::Raster>(job.scene.program.source).step_over / (2 * std::sqrt(3.0) * 5.0);
  held("piezo", piezo.rms(),
       std::hypot(rate * missed(limits.piezo.cycle_s, late(limits.piezo.loop)),
                  slope * on_the_part(job, along(job, aside, corrected), piezo).value),
       0.15);
  const BeyondIdeal table = left("table");
  const VectorXd tabulate =
      along(job, n, compensate(job, parse_case("perfect-position-table")).samples.states);
  held("table", table.rms(), on_the_part(job, tabulate - wanted, table).value, 0.02);
}

TEST(ChannelScenes, TheTablesOfThePackagedSceneStayWithinTheBoundOfTheirSpacing) {
  // C as the machine has it, 200 turns, of which tables hold what the program uses, then one turn
  for (const char* travel_deg : {"[-36000, 36000]", "[-180, 180]"}) {
    const bool one_turn = std::string(travel_deg) == "[-180, 180]";
    const Job job = job_of("gantry_channels.toml",
                           {{"part.vertices", "2500"}, {"machine.axis.C.travel_deg", travel_deg}});
    const cutting::Surface ideal = ideal_map(job);
    Job fine = job;
    fine.scene.compensation.table.options.spacing /= 16;
    fine.scene.compensation.table.options.spacing_rad = 0.5 * units::deg;
    fine.scene.compensation.table.options.max_points = 200000;
    const BeyondIdeal table = beyond_ideal(job, "perfect-position-table", ideal);
    const BeyondIdeal finer = beyond_ideal(fine, "perfect-position-table", ideal);
    const double added = (table.by - finer.by).cwiseAbs().maxCoeff();
    const double bound = spacing_bound(job, normal_by_axis(job));
    std::cout << "C in " << travel_deg << " deg: tables leave " << table.rms() / units::nm
              << " nm RMS, fine ones " << finer.rms() / units::nm << " nm; the spacing adds up to "
              << added / units::nm << " nm, at most by its bound " << bound / units::nm << " nm\n";
    EXPECT_LE(added, 1.02 * bound);
    EXPECT_LT(table.rms(), 0.3_um);
    if (one_turn) {
      EXPECT_GE(added, 0.3 * bound);
    }
  }
}

// --- a day of drift at signal level

using compensation::Insertion;
using compensation::Request;
using compensation::TimeSeries;

constexpr double period = 1e-3;  // mm, signal of the encoder
constexpr double cycle_s = 10e-3, pulse_s = 2e-6, stroke = 0.5, stroke_s = 0.1;

/// The scene's other day up to the program, on which nothing was learnt.
Job other_day() {
  const Scene scene = read_scene(packaged("thermal_protocol_chen.toml"));
  std::vector<Override> changes = scene.variants.at(0).set;
  changes.insert(changes.end(), {{"part.vertices", "100"}, {"program.step_over_mm", "10"}});
  return job_of("thermal_protocol_chen.toml", changes);
}

/// What is wanted of Z: what the four sensors say of the spindle, taken back.
TimeSeries wanted_of_sensors(const Job& job) {
  Evidence evidence;
  evidence.log = control_log(job, uncompensated_commands(job), {});
  const compensation::MachineBelief belief =
      machine_belief(make_control_view(job, job), parse_case("thermal-position-ideal"), evidence);
  const compensation::ThermalSeries& course = belief.thermal.value();
  std::cout << "readings held at the end of what was trained: " << course.limited_rows << " of "
            << course.time_s.size() << "\n";
  EXPECT_EQ(course.terms.size(), 1u);
  EXPECT_EQ(course.terms[0].component, 2) << "along Z";
  const Index rows =
      std::count_if(course.time_s.begin(), course.time_s.end(), [](double t) { return t <= 0.0; });
  return {course.time_s.head(rows), -course.value.topRows(rows)};
}

/// Z goes up and down once after every reading and rests until the next.
TimeSeries strokes(const TimeSeries& wanted, double z) {
  const Index n = wanted.time_s.size() - 1;
  TimeSeries motion{VectorXd(3 * n + 1), MatrixXd(3 * n + 1, 1)};
  for (Index k = 0; k < n; ++k) {
    motion.time_s.segment<3>(3 * k) =
        wanted.time_s[k] + Eigen::Array3d(0.0, stroke_s, 2 * stroke_s);
    motion.value.col(0).segment<3>(3 * k) = Eigen::Array3d(z, z + stroke, z);
  }
  motion.time_s[3 * n] = wanted.time_s[n];
  motion.value(3 * n, 0) = z;
  return motion;
}

/// Part of the motion with each pair carried out at once by the loop.
TimeSeries carried(const TimeSeries& motion, Index first, double offset,
                   const std::vector<Insertion>& pairs) {
  std::vector<std::pair<double, double>> knots;
  std::size_t next = 0;
  const auto jump_until = [&](double time_s) {
    for (; next < pairs.size() && pairs[next].time_s + pulse_s <= time_s; ++next) {
      const double at_s = pairs[next].time_s + pulse_s + 1e-9;  // after the pair, whole in itself
      const double z = compensation::value_at(motion, at_s)[0];
      knots.emplace_back(at_s, z + offset);
      offset -= pairs[next].direction * period;
      knots.emplace_back(at_s, z + offset);
    }
  };
  for (Index i = first; i < first + 4; ++i) {
    jump_until(motion.time_s[i] - 1e-8);
    knots.emplace_back(motion.time_s[i], motion.value(i, 0) + offset);
  }
  TimeSeries course{VectorXd(Index(knots.size())), MatrixXd(Index(knots.size()), 1)};
  for (std::size_t i = 0; i < knots.size(); ++i) {
    course.time_s[Index(i)] = knots[i].first;
    course.value(Index(i), 0) = knots[i].second;
  }
  return course;
}

/// Counts that the computer wants to be corrected at every cycle of one minute, its first cycle.
struct Minute {
  long first_cycle;
  std::vector<long> whole;
};

Minute minute_of(const TimeSeries& wanted, Index row, double phase) {
  const double start = wanted.time_s[0];
  Minute minute{std::lround(std::ceil((wanted.time_s[row] - start) / cycle_s - 1e-6)), {}};
  for (long k = minute.first_cycle; start + double(k) * cycle_s < wanted.time_s[row + 1] - 1e-6;
       ++k)
    minute.whole.push_back(std::lround(
        compensation::value_at(wanted, start + double(k) * cycle_s)[0] / period - phase));
  return minute;
}

/// Encoder, computer, box and loop in a ring over one minute, closed pair by pair.
/// @param done  counts corrected before it. @return those after it
long counts_closed(const TimeSeries& motion, Index row, const Minute& minute, long done,
                   double phase) {
  std::vector<Insertion> pairs;
  for (;;) {
    const TimeSeries axis = carried(motion, 3 * row, double(done) * period, pairs);
    const compensation::Feedback encoder = compensation::feedback(axis, period, phase);
    std::vector<Request> requests;
    for (std::size_t k = 0; k < minute.whole.size(); ++k) {
      const double t = motion.time_s[0] + double(minute.first_cycle + long(k)) * cycle_s;
      long in = 0;
      for (const Insertion& pair : pairs)
        if (pair.time_s < t) in += pair.direction;
      // a pair of +1 makes the axis travel one count down
      const long left = (done - in) - minute.whole[k];
      requests.push_back({t, in + std::clamp(left, -1L, 1L)});
    }
    const std::vector<Insertion> next =
        compensation::insertions(encoder, requests, {false, pulse_s});
    if (next.size() <= pairs.size()) {
      // what the control counts is the programmed motion: it does not see that it was carried
      const long seen = compensation::count_at(
          compensation::counts(compensation::inserted(encoder, requests, {false, pulse_s})), 1e9);
      const double x = motion.value(3 * row, 0) / period - phase;
      EXPECT_LE(std::abs(seen), std::abs(x - std::round(x)) < 1e-6 ? 1 : 0);
      for (const Insertion& pair : pairs) done -= pair.direction;
      return done;
    }
    pairs.assign(next.begin(), next.begin() + std::ptrdiff_t(pairs.size()) + 1);
  }
}

/// Largest and root mean square of a drift, mm.
Spread spread_of(const VectorXd& drift) {
  return {std::sqrt(drift.squaredNorm() / double(drift.size())), drift.cwiseAbs().maxCoeff()};
}

TEST(ChannelScenes, PulsesCarryTheSpindleBackOverADayAtSignalLevel) {
  const Job job = other_day();
  const TimeSeries wanted = wanted_of_sensors(job);
  const int Z = job.machine.control.find('Z').value();
  kinematics::AxisState state;
  state.q = slide_offset(job.machine.control,
                         Vector3d(0, 0, 80) - job.machine.control
                                                  .tool_in_workpiece(kinematics::AxisVector::Zero(
                                                      job.machine.control.size()))
                                                  .translation());
  const double z = state.q[Z];
  const TimeSeries motion = strokes(wanted, z);
  compensation::PulseInsertion pulses{VectorXd::Constant(1, period), cycle_s, pulse_s, 3};
  const double phase = compensation::zero_phase(pulses.phase_seed, 0);
  const TimeSeries fast = compensation::apply_channel(wanted, pulses, motion);

  const auto height = [&](double time_s, double correction) {
    kinematics::AxisState at = state;
    at.time_s = time_s;
    at.q[Z] += correction;
    return tool_in_workpiece(job.truth, at).translation().z();
  };
  const Index n = wanted.time_s.size();
  const long start = std::lround(wanted.value(0, 0) / period - phase);
  const double zero = height(wanted.time_s[0], 0.0);
  VectorXd before(n - 1), after(n - 1);
  double apart = 0.0;
  long done = start, pairs = 0;
  for (Index row = 0; row + 1 < n; ++row) {
    const long next = counts_closed(motion, row, minute_of(wanted, row, phase), done, phase);
    pairs += std::abs(next - done);
    done = next;
    const double end_s = wanted.time_s[row + 1], travelled = double(done - start) * period;
    before[row] = height(end_s, 0.0) - zero;
    after[row] = height(end_s, travelled) - zero;
    apart = std::max(apart, std::abs(compensation::value_at(fast, end_s - 0.5 * cycle_s)[0] -
                                     fast.value(0, 0) - travelled));
  }
  const Spread was = spread_of(before), is = spread_of(after);
  std::cout << "spindle along Z over " << (wanted.time_s[n - 1] - wanted.time_s[0]) / 3600
            << " h: drifts by up to " << was.max / units::um << " um (RMS " << was.rms / units::um
            << "), with " << pairs << " pairs of 1 um by up to " << is.max / units::um
            << " um (RMS " << is.rms / units::um << "); off the fast model by " << apart / units::nm
            << " nm\n";
  EXPECT_GT(was.max, 20.0_um);
  EXPECT_GT(pairs, 20);
  EXPECT_LT(apart, 1e-9);
  EXPECT_LT(is.max, 0.2 * was.max);
}

// --- signals

TEST(ChannelScenes, SignalsTellWhatAChannelAdds) {
  const Job job = job_of_flat(
      "[0, 0, 0]",
      lift(0.1) + "[compensation.pulses]\ncount_um = 0.25\n[signals]\ninterval_s = 0.01\n");
  EXPECT_TRUE(cut(job).signals.columns.empty());
  EXPECT_TRUE(cut(job, parse_case("perfect-position-ideal")).signals.columns.empty());
  const double phase =
      compensation::zero_phase(job.scene.seed, job.machine.control.find('Z').value());
  for (const char* name : {"pulses", "open", "origin", "table"}) {
    const auto signals =
        columns(cut(job, parse_case(std::string("perfect-position-") + name)).signals);
    const VectorXd &X = signals.at("X_mm"), &dZ = signals.at("Z_correction_um");
    const double cut_height = signals.at("Z_mm").minCoeff();
    double worst = 0.0, off_count = 0.0;
    for (Index i = 0; i < X.size(); ++i) {
      if (std::abs(X[i]) > 18.0 || signals.at("Z_mm")[i] > cut_height + 1.0) continue;
      worst = std::max(worst, std::abs(dZ[i] + 0.1 * X[i]));
      off_count = std::max(off_count, std::abs(std::remainder(dZ[i] / 0.25 - phase, 1.0)));
    }
    std::cout << name << ": Z correction within " << worst << " um of what is wanted\n";
    EXPECT_LT(worst, 0.6) << name;
    EXPECT_FALSE(signals.contains("piezo_um"));
    if (std::string(name) == "pulses") {
      EXPECT_LT(off_count, 1e-3) << "whole counts";
    }
  }
  const auto piezo = columns(cut(job, parse_case("perfect-position-piezo")).signals);
  EXPECT_TRUE(piezo.contains("piezo_um"));
  EXPECT_FALSE(piezo.contains("Z_correction_um"));
}

}  // namespace
}  // namespace abbe::sim
