#include "sim/commands/export_command.h"

#include <memory>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "sim/cut/stages.h"
#include "sim/files/output.h"
#include "sim/files/terminal.h"
#include "sim/loop/compensate.h"
#include "sim/loop/correctors.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {
namespace {

using compensation::ControlFormat;

compensation::Export exported(const Job& job, const Learnt& learnt, ControlFormat format) {
  const kinematics::Chain& control = job.machine.control;
  try {
    if (format != ControlFormat::Isg)
      return compensation::to_control(tables_of(seen_of(job), learnt.corrector), control, format);
    if (!learnt.geometric)
      throw std::invalid_argument("expected geometric errors that are identified, seen none");
    return compensation::to_volumetric(*learnt.geometric, control, table_options(seen_of(job)));
  } catch (const std::logic_error& fault) {  // also out_of_range: a believed table ends too soon
    throw BadInput(job.scene.file.string(), 0, 0, "a correction that tables can hold",
                   fault.what());
  }
}

}  // namespace

Exported export_tables(const std::filesystem::path& file, const ExportOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const CaseDescription compensator = parse_case(options.case_name);
  trust(scene, compensator);
  const ResultFolder folder(options.folder, writer_of(scene, options.permissions));
  const auto rest = [&](const WorkSize& size) {
    return stages_of_commands(compensator.name, size, scene, compensator) +
           std::vector<Stage>{{"write", "tables", 0.5}};
  };
  ProgressLine progress(stages_of_preparing("prepare", expected_size(scene)) +
                        rest(expected_size(scene)));
  progress.begin("prepare");
  const Job job = prepare(scene, to(progress));
  progress.replan(rest(size_of(job)));
  progress.begin(compensator.name);
  const ControlFormat format =
      options.format.value_or(scene.compensation.table.format.value_or(ControlFormat::LinuxCnc));
  const Learnt known = learnt(job, compensator, to(progress));
  progress.begin("write");
  progress.report("tables", 0.0);
  const compensation::Export out = exported(job, known, format);
  Exported done{scene.title, options.case_name, format, {}, out.left_out, out.notes};
  for (const compensation::ControlFile& one : out.files) {
    write_file(folder / one.name, one.text);
    done.files.push_back((folder / one.name).path());
  }
  return done;
}

namespace {

nlohmann::ordered_json to_json(const Exported& done) {
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const std::filesystem::path& file : done.files) files.push_back(file.string());
  return {{"scene", done.scene},
          {"case", done.case_name},
          {"format", compensation::to_string(done.format)},
          {"files", files},
          {"left_out", done.left_out},
          {"notes", done.notes}};
}

/// What stands on the command line.
struct ExportWords {
  std::string format;
  ExportOptions options;
};

Exit print_exported(const Common& common, ExportWords words) {
  words.options.overrides = overrides(common);
  words.options.folder = result_folder(common) / (common.out.empty() ? "tables" : "");
  words.options.permissions = common.permissions;
  using compensation::ControlFormat;
  for (const ControlFormat one : {ControlFormat::LinuxCnc, ControlFormat::Isg,
                                  ControlFormat::Siemens, ControlFormat::Heidenhain})
    if (words.format == compensation::to_string(one)) words.options.format = one;
  check_case(words.options.case_name);
  const Exported done = export_tables(common.scene, words.options);
  if (common.json) {
    print("{}", Lines(json_text(to_json(done))));
    return Exit::Ok;
  }
  for (const std::filesystem::path& file : done.files) print("{}\n", file.string());
  for (const std::string& note : done.notes) print("{}\n", note);
  for (const std::string& one : done.left_out) print(stderr, "abbe: warning: left out: {}\n", one);
  return Exit::Ok;
}

}  // namespace

Command export_command(Common& common) {
  const auto words = std::make_shared<ExportWords>();
  return {"export",
          "Write the compensation tables of a scene as a control reads them",
          {"abbe export scenes/platform_plane.toml --out out/tables",
           "abbe export scenes/gantry_channels.toml --format siemens --case perfect-position-table "
           "--out out/siemens"},
          scene_options(common, {{"--out", &common.out, "folder for the tables (out/SCENE/tables)"},
                                 force_option(common),
                                 trust_option(common),
                                 {"--format", &words->format,
                                  "of which control (that of [compensation.table], else linuxcnc)",
                                  OneOf{{"linuxcnc", "isg", "siemens", "heidenhain"}}},
                                 {"--case", &words->options.case_name,
                                  "what the tables are made from (identified-position-table)"}}),
          [words, &common] { return print_exported(common, *words); }};
}

}  // namespace abbe::sim
