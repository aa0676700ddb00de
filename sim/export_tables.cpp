#include "sim/export_tables.h"

#include <stdexcept>

#include "sim/correctors.h"
#include "sim/output.h"

namespace abbe::sim {
namespace {

using compensation::ControlFormat;

compensation::Export exported(const Job& job, const Learnt& learnt, ControlFormat format) {
  const kinematics::Chain& control = job.machine.control;
  try {
    if (format != ControlFormat::Isg)
      return compensation::to_control(tables_of(job, learnt.corrector), control, format);
    if (!learnt.geometric)
      throw std::invalid_argument("expected geometric errors that are identified, seen none");
    return compensation::to_volumetric(*learnt.geometric, control, table_options(job));
  } catch (const std::logic_error& fault) {  // also out_of_range: a believed table ends too soon
    throw BadInput(job.scene.file.string(), 0, 0, "a correction that tables can hold",
                   fault.what());
  }
}

}  // namespace

nlohmann::ordered_json export_tables(const std::filesystem::path& file,
                                     const ExportOptions& options) {
  const Scene scene = read_scene(file, options.overrides);
  const Job job = prepare(scene);
  const ControlFormat format =
      options.format.value_or(scene.compensation.table.format.value_or(ControlFormat::LinuxCnc));
  const compensation::Export out =
      exported(job, learnt(job, parse_case(options.case_name)), format);
  prepare_folder(options.folder);
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const compensation::ControlFile& one : out.files) {
    write_file(options.folder / one.name, one.text);
    files.push_back((options.folder / one.name).string());
  }
  return {{"scene", scene.title},
          {"case", options.case_name},
          {"format", compensation::to_string(format)},
          {"files", files},
          {"left_out", out.left_out},
          {"notes", out.notes}};
}

}  // namespace abbe::sim
