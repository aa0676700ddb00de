// Readings that were written down wrong, by every instrument: none becomes a belief in silence.

#include "errors/coefficients.h"
#include "errors/curve.h"
#include "errors/metrology/instrument.h"
#include "kinematics/text.h"
#include "sim/calibration/calibration.h"
#include "sim/commands/calibration_commands.h"
#include "sim/commands/scene_runs.h"
#include "sim/measure/measure.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/toml.h"
#include "tests/sim/measured_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using errors::metrology::Kind;
using errors::metrology::Readings;

// ---------------------------------------------------------------- what is done to readings

std::string half_of(const std::string& text) {
  const std::size_t head = text.rfind("\n# ");
  const std::size_t rows = text.find('\n', head + 1) + 1;
  return text.substr(0, text.find('\n', rows + (text.size() - rows) / 2) + 1);
}

std::string with_nan(std::string text) {
  const std::size_t at =
      text.rfind(",mm") != std::string::npos ? text.rfind(",mm") : text.rfind(",rad");
  const std::size_t comma = text.rfind(',', at - 1);
  return text.replace(comma + 1, at - comma - 1, "nan");
}

/// The rows below the head of a machine with other axes.
std::string of_other_machine(const std::string& text) {
  const Scene other = scene_of(measured_scene("", "three_axis_table"));
  InstrumentDescription laser = find_instrument(other, "laser");
  const std::string head = to_text(measure_machine(other, laser));
  const auto joints = [](const std::string& t) {
    const std::size_t from = t.find("# [[joint]]"), to = t.find("# [[set_up]]");
    return std::pair(from, to - from);
  };
  const auto [from, count] = joints(text);
  const auto [other_from, other_count] = joints(head);
  return std::string(text).replace(from, count, head.substr(other_from, other_count));
}

/// Readings as a file, after a mistake. Empty: the instrument has nothing that it could be made
/// with.
using Corruption = std::function<std::string(Readings)>;

std::string scaled_text(Readings r, double factor) {
  r.value *= factor;
  return to_text(r);
}

std::string constant(Readings r, double value) {
  r.value.setConstant(value);
  return to_text(r);
}

std::string with_noise(Readings r) {
  for (std::size_t i = 0; i < r.plan.measurements.size(); ++i) {
    const auto& measurement = r.plan.measurements[i];
    const double noise = errors::metrology::standard_deviation(
        r.plan.set_ups[std::size_t(measurement.set_up)].channels[std::size_t(measurement.channel)]);
    r.value[Index(i)] += 300.0 * noise * errors::normal_deviate(99, i);
  }
  return to_text(r);
}

/// Readings of the first two channels of every set-up exchanged.
std::string with_channels_exchanged(Readings r) {
  bool is_changed = false;
  for (std::size_t i = 0; i + 1 < r.plan.measurements.size(); ++i) {
    const auto &a = r.plan.measurements[i], &b = r.plan.measurements[i + 1];
    if (a.set_up != b.set_up || a.channel != 0 || b.channel != 1) continue;
    std::swap(r.value[Index(i)], r.value[Index(i) + 1]);
    is_changed = true;
  }
  return is_changed ? to_text(r) : "";
}

/// Columns of the positions of X and Y exchanged.
std::string with_axes_exchanged(Readings r) {
  const int x = *r.nominal.find('X'), y = *r.nominal.find('Y');
  bool is_changed = false;
  for (auto& measurement : r.plan.measurements) {
    is_changed = is_changed || measurement.state.q[x] != measurement.state.q[y];
    std::swap(measurement.state.q[x], measurement.state.q[y]);
  }
  return is_changed ? to_text(r) : "";
}

const std::vector<std::pair<std::string, Corruption>>& corruptions() {
  static const std::vector<std::pair<std::string, Corruption>> list = {
      {"all 0", [](Readings r) { return constant(std::move(r), 0.0); }},
      {"constant", [](Readings r) { return constant(std::move(r), 0.0123); }},
      {"x 1000", [](Readings r) { return scaled_text(std::move(r), 1000.0); }},
      {"/ 1000", [](Readings r) { return scaled_text(std::move(r), 1e-3); }},
      {"negated", [](Readings r) { return scaled_text(std::move(r), -1.0); }},
      {"reversed",
       [](Readings r) {
         r.value.reverseInPlace();
         return to_text(r);
       }},
      {"channels exchanged", with_channels_exchanged},
      {"X and Y exchanged", with_axes_exchanged},
      {"truncated", [](const Readings& r) { return half_of(to_text(r)); }},
      {"NaN", [](const Readings& r) { return with_nan(to_text(r)); }},
      {"noise x 300", with_noise},
      {"other machine", [](const Readings& r) { return of_other_machine(to_text(r)); }}};
  return list;
}

// ---------------------------------------------------------------- what comes of it

IdentificationOptions options_in(const SceneFolder& folder, Kind kind) {
  IdentificationOptions options;
  options.model.order = 3;
  options.out = folder.path() / "belief.toml";
  options.permissions.force = true;
  if (kind == Kind::StepDiagonal) options.method = IdentificationOptions::Method::StepDiagonal;
  return options;
}

/// Numbers of a belief by name.
std::map<std::string, std::pair<double, double>> numbers_of(
    const IdentificationResult& identified) {
  std::map<std::string, std::pair<double, double>> numbers;
  const auto& belief = identified.belief;
  const auto all = errors::coefficients(belief.elements);
  const VectorXd values = errors::values(belief.elements);
  for (std::size_t i = 0; i < belief.covariance.of.size(); ++i) {
    const auto at = std::ranges::find(all, belief.covariance.of[i]) - all.begin();
    const auto k = Index(i);
    numbers[errors::name_of(belief.covariance.of[i], belief.elements)] = {
        values[at], std::sqrt(belief.covariance.matrix(k, k))};
  }
  return numbers;
}

/// Whether two beliefs are the same as far as they are known.
bool is_same(const IdentificationResult& a, const IdentificationResult& b) {
  constexpr double close =
      6.0;  // standard deviations of one: of hundreds of numbers none is beyond
  const auto left = numbers_of(a), right = numbers_of(b);
  for (const auto& [name, number] : left) {
    const auto at = right.find(name);
    if (at == right.end()) return false;
    if (std::abs(number.first - at->second.first) >
        close * std::max(number.second, at->second.second))
      return false;
  }
  return left.size() == right.size();
}

std::string new_in(const std::vector<std::string>& now, const std::vector<std::string>& before) {
  for (const std::string& text : now)
    if (std::ranges::find(before, text) == before.end()) return text;
  return "";
}

/// "error", "warning", "assumed", "same belief", or "SILENT"; `text` is what was said.
struct Outcome {
  std::string kind;
  std::string text;
};

Outcome outcome_of(const fs::path& file, const IdentificationResult& clean,
                   const IdentificationOptions& options) {
  try {
    const IdentificationResult found = identified({file}, options);
    if (const std::string text = new_in(found.warnings, clean.warnings); !text.empty())
      return {"warning", text};
    if (is_same(found, clean)) return {"same belief", ""};
    if (!found.assumptions.empty()) return {"assumed", found.assumptions.front()};
    return {"SILENT", ""};
  } catch (const std::exception& fault) {
    return {"error", fault.what()};
  }
}

Outcome outcome_of_evaluating(const fs::path& file) {
  try {
    const Evaluation found = evaluate_readings(file);
    return {found.warnings.empty() ? "evaluated" : "warning",
            found.warnings.empty() ? "" : found.warnings.front()};
  } catch (const std::exception& fault) {
    return {"error", fault.what()};
  }
}

InstrumentDescription small_instrument(Kind kind) {
  InstrumentDescription description;
  description.instrument = errors::metrology::typical_instrument(kind);
  description.instrument.name = errors::metrology::to_string(kind);
  description.starts_s = {0.0};
  if (kind == Kind::Multilateration || kind == Kind::Tracker) description.instrument.targets = 4;
  if (kind == Kind::BallBar || kind == Kind::BallBarRotary) description.instrument.targets = 72;
  return description;
}

// What is allowed of a mistake that nothing in one file shows: the sign or the order of readings
// that do not change on the nominal machine, which then must be said to be assumed.
TEST(WrongReadings, OfEveryInstrumentNeverBecomeABeliefInSilence) {
  const Scene scene = read_scene(packaged("gantry_calibration.toml"));
  std::map<std::string, std::map<std::string, Outcome>> table;
  for (const Kind kind : errors::metrology::all_kinds()) {
    if (kind == Kind::Drift || kind == Kind::Temperature) continue;  // of a day, below
    const std::string name = errors::metrology::to_string(kind);
    const SceneFolder folder;
    const Readings readings = measure_machine(scene, small_instrument(kind));
    const IdentificationOptions options = options_in(folder, kind);
    const IdentificationResult clean =
        identified({folder.write(name + ".csv", to_text(readings))}, options);
    for (const auto& [mistake, corrupt] : corruptions()) {
      const std::string text = corrupt(readings);
      if (text.empty()) continue;
      const auto file = folder.write(name + ".csv", text);
      const Outcome outcome = table[name][mistake] = outcome_of(file, clean, options);
      EXPECT_NE(outcome.kind, "SILENT") << name << ", " << mistake;
      const bool may_be_assumed =
          mistake == "negated" || mistake == "reversed" || mistake.ends_with("exchanged");
      if (!may_be_assumed) {
        EXPECT_NE(outcome.kind, "assumed") << name << ", " << mistake << ": " << outcome.text;
      }
      const bool is_certain = mistake == "all 0" || mistake == "constant" ||
                              mistake == "truncated" || mistake == "NaN" ||
                              mistake == "other machine";
      if (is_certain) {
        EXPECT_EQ(outcome.kind, "error") << name << ", " << mistake << ": " << outcome.text;
        EXPECT_EQ(outcome_of_evaluating(file).kind, "error") << name << ", " << mistake;
      }
    }
  }
  for (const auto& [name, row] : table)
    for (const auto& [mistake, outcome] : row)
      std::cout << fmt::format("{:16} {:20} {:12} {:.150}\n", name, mistake, outcome.kind,
                               outcome.text);
}

// A day of drift with temperatures, which a thermal belief is made of.
TEST(WrongReadings, OfADayNeverBecomeAThermalBeliefInSilence) {
  const Readings readings =
      measure_day("", read_scene(packaged("thermal_protocol_chen.toml"))).readings;
  const SceneFolder folder;
  IdentificationOptions options;
  options.method = IdentificationOptions::Method::Thermal;
  options.out = folder.path() / "belief_thermal.txt";
  const IdentificationResult clean =
      identified({folder.write("day.csv", to_text(readings))}, options);
  std::vector<std::pair<std::string, std::string>> texts;
  for (const auto& [mistake, corrupt] : corruptions())
    if (mistake == "all 0" || mistake == "constant" || mistake == "x 1000" || mistake == "NaN" ||
        mistake == "truncated" || mistake == "noise x 300" || mistake == "/ 1000")
      texts.emplace_back(mistake, corrupt(readings));
  Readings kelvin = readings, dead = readings;
  kelvin.T_C.array() += 273.15;
  dead.T_C.col(0).setConstant(20.0);
  texts.emplace_back("kelvin", to_text(kelvin));
  texts.emplace_back("dead sensor", to_text(dead));
  for (const auto& [mistake, text] : texts) {
    const Outcome outcome = outcome_of(folder.write("day.csv", text), clean, options);
    std::cout << fmt::format("drift            {:20} {:12} {:.150}\n", mistake, outcome.kind,
                             outcome.text);
    EXPECT_TRUE(outcome.kind == "error" || outcome.kind == "warning") << mistake;
  }
}

TEST(WrongReadings, OfAPartAreErrorsOrWarnings) {
  PartReadingsFile file{"cmm", "cmm", "a part", {}};
  const int n = 40;
  auto& r = file.readings;
  r.points_w.setZero(n, 3);
  r.normals_w.setZero(n, 3);
  r.normals_w.col(2).setOnes();
  r.deviation.resize(n);
  r.time_s.setLinSpaced(n, 0.0, 39.0);
  r.sigma = 0.5e-3;
  for (int i = 0; i < n; ++i) {
    r.points_w(i, 0) = 5.0 * (i % 8);
    r.points_w(i, 1) = 5.0 * (i / 8);
    r.deviation[i] =
        5e-3 * std::sin(0.3 * i) + r.sigma * errors::normal_deviate(7, std::uint64_t(i));
  }
  const SceneFolder folder;
  const auto outcome_with = [&](const std::function<void(PartReadingsFile&)>& change) {
    PartReadingsFile changed = file;
    change(changed);
    return outcome_of_evaluating(folder.write("part.csv", to_text(changed))).kind;
  };
  EXPECT_EQ(outcome_with([](PartReadingsFile&) {}), "evaluated");
  EXPECT_EQ(outcome_with([](PartReadingsFile& f) { f.readings.deviation.setZero(); }), "error");
  EXPECT_EQ(outcome_with([](PartReadingsFile& f) { f.readings.deviation *= 1000.0; }), "warning");
  EXPECT_EQ(outcome_with([](PartReadingsFile& f) { f.readings.deviation *= 1e-3; }), "warning");
  const std::string text = to_text(file);
  EXPECT_EQ(outcome_of_evaluating(
                folder.write("part.csv", text.substr(0, text.rfind('\n', text.size() - 2) + 1)))
                .kind,
            "error")
      << "a row is missing";
}

TEST(WrongReadings, ThatAreAnErrorLeaveNoBelief) {
  const SceneFolder folder;
  const Scene gantry = read_scene(packaged("gantry_calibration.toml"));
  const IdentificationOptions options = options_in(folder, Kind::Laser);
  const std::string dead = constant(measure_machine(gantry, small_instrument(Kind::Laser)), 0.0);
  EXPECT_THROW(identify({folder.write("laser.csv", dead)}, options), BadScene);
  EXPECT_FALSE(fs::exists(options.out));
}

// What another machine's belief holds is no belief of this one.
TEST(WrongReadings, ABeliefOfAnotherMachineIsAnInputError) {
  const SceneFolder folder;
  const Scene gantry = read_scene(packaged("gantry_calibration.toml"));
  IdentificationOptions options = options_in(folder, Kind::Laser);
  identify(
      {folder.write("laser.csv", to_text(measure_machine(gantry, small_instrument(Kind::Laser))))},
      options);
  EXPECT_NO_THROW(
      read_scene(packaged("gantry_dome.toml"), {{"errors", "\"" + options.out.string() + "\""}}));
  const std::string said = thrown_text<BadScene>([&] {
    scene_of(measured_scene("", "three_axis_table"),
             {{"errors", "\"" + options.out.string() + "\""}});
  });
  EXPECT_HAS(said, "errors of the machine");
}

}  // namespace
}  // namespace abbe::sim
