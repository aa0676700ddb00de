#include "sim/commands/measure_command.h"

#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "sim/cut/reach.h"
#include "sim/cut/stages.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/loop/compensate.h"
#include "sim/readings/readings_file.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"
#include "sim/scene/value_warnings.h"

namespace abbe::sim {
namespace {

using errors::metrology::Readings;

/// None for a case without.
std::optional<CaseDescription> compensator_of_part(const std::string& name) {
  if (name.empty() || name == "error_free" || name == "uncompensated") return std::nullopt;
  return parse_case(name);
}

Cut cut_case(const Job& job, const std::string& name, const Progress& progress) {
  if (name == "error_free") return cut_error_free(job, progress);
  return cut(job, compensator_of_part(name), progress);
}

/// Instruments to use: those named, or every one of the scene.
struct Chosen {
  std::vector<InstrumentDescription> of_machine;
  std::vector<PartInstrumentDescription> of_part;
};

Chosen chosen(const Scene& scene, const std::vector<std::string>& names) {
  if (names.empty()) return {scene.instruments, scene.part_instruments};
  Chosen result;
  for (const std::string& name : names) {
    if (auto of_part = part_instrument_of(scene, name))
      result.of_part.push_back(std::move(*of_part));
    else
      result.of_machine.push_back(instrument_of(scene, name));
  }
  return result;
}

struct CutAndMeasured {
  PartReadingsFile file;
  std::vector<std::string> warnings;  ///< of the cut
};

CutAndMeasured cut_and_measured(const Scene& scene, const PartInstrumentDescription& instrument,
                                const Progress& progress = {}) {
  const Job job = placed(prepare(scene, progress));
  const Cut made = cut_case(job, instrument.case_name, progress);
  check_cuts_part(job, made);
  return {measured_part(job, made, instrument), warnings_of(job, made)};
}

/// What measuring will take: the machine in a moment, a part as long as it is cut.
std::vector<Stage> stages_of(const Scene& scene, const Chosen& chosen) {
  std::vector<Stage> stages;
  if (!chosen.of_machine.empty())
    stages = {{"machine", "measure", 0.1 * double(chosen.of_machine.size())}};
  const WorkSize size = expected_size(scene);
  for (const PartInstrumentDescription& one : chosen.of_part)
    stages = std::move(stages) + stages_of_preparing(one.name, size) +
             (one.case_name == "error_free"
                  ? stages_of_error_free(one.name, size)
                  : stages_of_cut(one.name, size, scene, compensator_of_part(one.case_name)));
  return stages;
}

/// The file of an instrument, with at least one reading.
Measured whole(Measured one, const Scene& scene, const std::string& instrument) {
  if (one.readings == 0)
    throw BadInput(scene.file.string(), 0, 0, "readings of " + instrument, "none");
  return one;
}

}  // namespace

PartReadingsFile measured_part(const Scene& scene, const PartInstrumentDescription& instrument) {
  return cut_and_measured(scene, instrument).file;
}

std::vector<Measured> measure(const std::filesystem::path& file, const MeasureOptions& options) {
  const Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const Chosen instruments = chosen(scene, options.instruments);
  if (instruments.of_machine.empty() && instruments.of_part.empty())
    throw BadInput(file.string(), 0, 0, "[[instrument]] tables, or --instrument NAME", "none");
  const ResultFolder folder(options.folder, writer_of(scene, options.permissions));
  for (const InstrumentDescription& one : instruments.of_machine)
    check_file(folder / (one.instrument.name + ".csv"));
  for (const PartInstrumentDescription& one : instruments.of_part)
    check_file(folder / (one.name + ".csv"));
  std::vector<Measured> written;
  ProgressLine progress(stages_of(scene, instruments));
  if (!instruments.of_machine.empty()) progress.begin("machine");
  const std::vector<Readings> all = measured(scene, instruments.of_machine);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Readings& readings = all[i];
    const InstrumentDescription& one = instruments.of_machine[i];
    const ResultFile csv = folder / (one.instrument.name + ".csv");
    written.push_back(whole({csv.path(), readings.plan.looks.size(), readings.plan.set_ups.size(),
                             readings.plan.duration_s},
                            scene, one.instrument.name));
    if (i == 0) written.back().warnings = value_warnings(scene);  // once, not for every instrument
    write_table(csv, to_text(readings));
  }
  for (const PartInstrumentDescription& one : instruments.of_part) {
    progress.begin(one.name);
    const CutAndMeasured part = cut_and_measured(scene, one, to(progress));
    const ResultFile csv = folder / (one.name + ".csv");
    const Eigen::VectorXd& t = part.file.readings.time_s;
    written.push_back(whole({csv.path(), std::size_t(t.size()), 1,
                             t.size() > 0 ? t.maxCoeff() - t.minCoeff() : 0.0, part.warnings},
                            scene, one.name));
    write_table(csv, to_text(part.file));
  }
  return written;
}

namespace {

Exit print_measured(const Common& common, const std::vector<std::string>& instruments) {
  MeasureOptions options;
  options.overrides = overrides(common);
  options.instruments = instruments;
  options.folder = result_folder(common) / (common.out.empty() ? "readings" : "");
  options.permissions = common.permissions;
  const std::vector<Measured> all = measure(common.scene, options);
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  double hours = 0.0;
  for (const Measured& one : all) {
    json.push_back({{"file", one.file.string()},
                    {"readings", one.readings},
                    {"set_ups", one.set_ups},
                    {"hours", one.duration_s / 3600.0},
                    {"warnings", one.warnings}});
    print_warnings(one.warnings);
    hours += one.duration_s / 3600.0;
  }
  if (common.json) {
    print("{}", Lines(json_text(json)));
    return Exit::Ok;
  }
  print("{:>10} {:>9} {:>9}   file\n", "readings", "set-ups", "hours");
  for (const Measured& one : all)
    print("{:>10} {:>9} {:>9.2f}   {}\n", one.readings, one.set_ups, one.duration_s / 3600.0,
          one.file.string());
  print("\n{:.1f} hours on a real machine, setting up included\n", hours);
  return Exit::Ok;
}

}  // namespace

Command measure_command(Common& common) {
  const auto instruments = std::make_shared<std::vector<std::string>>();
  return {
      "measure",
      "Measure the machine of a scene with virtual instruments",
      {"abbe measure scenes/gantry_calibration.toml --out out/calibration",
       "abbe measure scenes/gantry_calibration.toml --instrument ball_bar --seed 7 --out "
       "out/ball_bar"},
      scene_options(common, {{"--out", &common.out, "folder for the readings (out/SCENE/readings)"},
                             force_option(common),
                             trust_option(common),
                             {"--instrument", instruments.get(),
                              "name of an [[instrument]] of the scene, or a kind such as laser, "
                              "ball_bar, r_test (repeatable; all of the scene)"}}),
      [instruments, &common] { return print_measured(common, *instruments); }};
}

}  // namespace abbe::sim
