#include "sim/commands/identify_command.h"

#include "sim/files/output.h"
#include "sim/report/identify_pictures.h"

namespace abbe::sim {
namespace {

/// What identify leaves: the belief, its report and its picture, side by side.
struct BeliefFiles {
  ResultFile belief, report, picture;
};

/// @param readings  that are read, and never written over
BeliefFiles files_of(const IdentifyOptions& options,
                     const std::vector<std::filesystem::path>& readings) {
  const Writer writer{options.permissions, readings};
  std::filesystem::path file = options.out;
  const ResultFile belief = result_file(file, writer);
  const ResultFile report = result_file(file.replace_extension(".json"), writer);
  return {belief, report, result_file(file.replace_extension(".png"), writer)};
}

/// Refuses, before the work, what files_of would refuse; no folder is made yet.
void check_files(const IdentifyOptions& options,
                 const std::vector<std::filesystem::path>& readings) {
  const Writer writer{options.permissions, readings};
  std::filesystem::path file = options.out;
  check_file(file, writer);
  for (const char* beside : {".json", ".png"}) check_file(file.replace_extension(beside), writer);
}

}  // namespace

nlohmann::ordered_json identify(const std::vector<std::filesystem::path>& files,
                                const IdentifyOptions& options) {
  check_files(options, files);
  const Identified found = identified(files, options);
  const BeliefFiles out = files_of(options, files);
  write_table(out.belief, found.belief);
  write_json(out.report, found.report);
  if (!found.thermal_belief.empty())
    write_table(result_file(thermal_file(options.out), {options.permissions, files}),
                found.thermal_belief);
  if (found.curves.empty()) return found.report;
  std::string from;
  for (const auto& file : files) from += (from.empty() ? "" : ", ") + file.string();
  write_curves_picture(out.picture, found.curves, found.nominal, from);
  return found.report;
}

}  // namespace abbe::sim
