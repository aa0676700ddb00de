#include "sim/report/case_files.h"

#include <future>

#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "sim/report/collision_report.h"
#include "sim/report/pictures.h"
#include "sim/report/result_files.h"
#include "sim/report/stock_check.h"
#include "sim/report/summary_report.h"
#include "sim/scene/toml_text.h"

namespace abbe::sim {
namespace {

/// A file that only some cases have: where there is none, one of an earlier run goes.
void write_or_remove(const ResultFile& file, const std::string& text) {
  if (text.empty())
    remove_file(file);
  else
    write_file(file, text);
}

void write_collisions(const ResultFile& file, const Cut& cut) {
  if (!cut.collisions) return remove_file(file);
  Collisions found = *cut.collisions;
  found.commands = cut.name;
  write_json(file, to_json(found));
}

/// The machined body; its picture and the file for ParaView are those of the pictures.
void write_stock_mesh(const ResultFile& file, const Job& job, const Verdict& verdict) {
  if (!verdict.stock) return remove_file(file);
  write_file(file, to_stl(*verdict.stock, job, verdict));
}

}  // namespace

void write_program(const ResultFolder& folder, const Job& job) {
  if (job.program_text.empty()) return;
  write_file(folder / job.path.file, job.program_text);
}

void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                const std::vector<std::string>& formats, const Progress& progress) {
  // what is written and what is drawn share only the mark of the folder, which has a lock
  std::future<void> files =
      std::async(std::launch::async, [&] { write_map_files(folder, job, verdict, formats, {}); });
  write_case_pictures(folder, job, verdict, progress);
  write_source_pictures(folder, job, verdict);
  write_or_remove(folder / "signals.csv", verdict.cut.signals.columns.empty()
                                              ? ""
                                              : escaped_lines(to_csv(verdict.cut.signals)));
  write_file(folder / "scene.toml",
             "case = " + to_toml_value(verdict.cut.case_name) + "\n" + job.scene.resolved);
  const ResultFile rewritten =
      folder / ("rewritten" + std::filesystem::path(job.path.file).extension().string());
  write_or_remove(rewritten, verdict.cut.rewritten_program);
  write_stock_mesh(folder / "stock.stl", job, verdict);
  write_collisions(folder / "collisions.json", verdict.cut);
  files.get();
  // last, so that a summary stands for a finished case
  write_json(folder / "summary.json", to_json(summary(job, verdict)));
}

}  // namespace abbe::sim
