#include "sim/commands/identify_command.h"

#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/report/belief_text.h"
#include "sim/report/identify_json.h"
#include "sim/report/identify_pictures.h"

namespace abbe::sim {
namespace {

std::vector<std::filesystem::path> all_of(const BeliefFiles& files) {
  std::vector<std::filesystem::path> all{files.belief, files.report, files.picture};
  if (files.thermal) all.push_back(*files.thermal);
  return all;
}

}  // namespace

Identified identify(const std::vector<std::filesystem::path>& files,
                    const IdentifyOptions& options) {
  const Writer writer{options.permissions, files};  // readings are never written over
  const BeliefFiles out = belief_files(options);
  for (const std::filesystem::path& file : all_of(out)) check_file(file, writer);
  Identified found = identified(files, options);
  write_table(result_file(out.belief, writer), belief_text(found));
  write_json(result_file(out.report, writer), to_json(found));
  if (out.thermal) write_table(result_file(*out.thermal, writer), thermal_half_text(found));
  const auto* fit = std::get_if<ChainFit>(&found.fit);
  if (!fit || fit->curves.empty()) return found;
  std::string from;
  for (const auto& file : files) from += (from.empty() ? "" : ", ") + file.string();
  write_curves_picture(result_file(out.picture, writer), fit->curves, found.nominal, from);
  return found;
}

}  // namespace abbe::sim
