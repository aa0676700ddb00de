#include "sim/commands/export_tables.h"

#include <stdexcept>

#include "sim/files/output.h"
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

nlohmann::ordered_json export_tables(const std::filesystem::path& file,
                                     const ExportOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const CaseDescription compensator = parse_case(options.case_name);
  trust(scene, compensator);
  const ResultFolder folder(options.folder, writer_of(scene, options.permissions));
  const Job job = prepare(scene);
  const ControlFormat format =
      options.format.value_or(scene.compensation.table.format.value_or(ControlFormat::LinuxCnc));
  const compensation::Export out = exported(job, learnt(job, compensator), format);
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const compensation::ControlFile& one : out.files) {
    write_file(folder / one.name, one.text);
    files.push_back((folder / one.name).path().string());
  }
  return {{"scene", scene.title},
          {"case", options.case_name},
          {"format", compensation::to_string(format)},
          {"files", files},
          {"left_out", out.left_out},
          {"notes", out.notes}};
}

}  // namespace abbe::sim
