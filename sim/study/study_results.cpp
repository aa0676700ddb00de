#include "sim/study/study_results.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numeric>
#include <optional>

#include <fmt/format.h>

#include "cutting/map/residual.h"
#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/files/json_files.h"
#include "sim/files/output.h"
#include "sim/report/figures_page.h"
#include "sim/study/study_charts.h"
#include "sim/study/study_text.h"
#include "sim/study/uncertainty.h"

#if ABBE_RENDER
#include "render/heat_map.h"
#include "render/map_sheet.h"
#include "render/vtk_writer.h"
#endif

namespace abbe::sim::study {

namespace {

using Eigen::Index;
using nlohmann::ordered_json;
using std::filesystem::path;

#if ABBE_RENDER

constexpr std::size_t maps_on_a_page = 30, max_pages = 8;

cutting::Statistics statistics(const cutting::Design& design, const Eigen::VectorXd& map_um) {
  const Index n = map_um.size();
  cutting::Surface surface{map_um, Eigen::VectorXd::Zero(n), std::vector<int>(std::size_t(n)), {}};
  for (const double value : map_um)
    surface.status.push_back(std::isfinite(value) ? cutting::VertexStatus::Cut
                                                  : cutting::VertexStatus::Uncut);
  return cutting::statistics(surface, design);
}

std::string figures(const char* name, std::optional<double> rms, std::optional<double> other) {
  return rms && other ? fmt::format("RMS {:.3g} µm   {} {:.3g} µm", *rms, name, *other)
                      : "nothing is cut";
}

std::string title_of(const PreparedStudy& ready, std::size_t arm, const char* what) {
  return fmt::format("{}, {}: {}", ready.study.title, ready.study.arms[arm].name, what);
}

/// Returns the map of one standard deviation of an input.
render::SheetMap effect_map(const PreparedStudy& ready, const InfluenceMap& influence, Index input,
                            const Eigen::MatrixXd& all, const Eigen::VectorXd& sd) {
  const Input& one = ready.study.inputs[std::size_t(input)];
  render::SheetMap map;
  map.title = one.unit.empty()
                  ? one.name
                  : fmt::format("{}, {:.3g} {}", one.name, sd[input], shown_unit(one.unit));
  map.values_um = all.row(input).transpose() * (sd[input] / units::um);
  const cutting::Statistics found = statistics(influence.design, map.values_um);
  map.figures = figures("PV", found.rms, found.pv);
  return map;
}

render::SheetOptions sheet_options(const PreparedStudy& ready, std::size_t arm, std::string title) {
  const Scene& scene = ready.arms[arm].job.scene;
  render::SheetOptions options;
  options.title = std::move(title);
  options.from = scene.view.from;
  options.up = scene.view.up;
  return options;
}

/// Returns the inputs sorted by the RMS of the effect of one standard deviation, largest first,
/// ties in their order.
std::vector<Index> inputs_by_effect(const InfluenceMap& influence, const Eigen::MatrixXd& all,
                                    const Eigen::VectorXd& sd) {
  std::vector<double> rms;
  for (Index i = 0; i < all.rows(); ++i)
    rms.push_back(statistics(influence.design, all.row(i).transpose() * sd[i]).rms.value_or(0.0));
  std::vector<Index> order(std::size_t(all.rows()));
  std::iota(order.begin(), order.end(), Index(0));
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return rms[std::size_t(a)] > rms[std::size_t(b)]; });
  return order;
}

/// Writes pages of maps. Pages of an earlier study with more inputs are removed.
void write_pages(const ResultFolder& folder, const PreparedStudy& ready, std::size_t arm,
                 const Eigen::MatrixXd& all, const Eigen::VectorXd& sd, PictureNames& names) {
  const InfluenceMap& influence = ready.influences[arm];
  const std::vector<Index> order = inputs_by_effect(influence, all, sd);
  const std::size_t pages = (order.size() + maps_on_a_page - 1) / maps_on_a_page;
  for (std::size_t page = 0; page < max_pages; ++page) {
    std::vector<std::string> name{"influence", "sheet"};
    if (page > 0) name.push_back(std::to_string(page + 1));
    const ResultFile file = folder / (names.unused(name) + ".png");
    if (page >= pages) {
      if (page > 0) remove_file(file);
      continue;
    }
    const std::size_t first = page * maps_on_a_page,
                      last = std::min(order.size(), first + maps_on_a_page);
    std::vector<render::SheetMap> maps;
    for (std::size_t k = first; k < last; ++k)
      maps.push_back(effect_map(ready, influence, order[k], all, sd));
    render::SheetOptions options = sheet_options(
        ready, arm, title_of(ready, arm, "what one standard deviation of each input does"));
    options.caption.push_back(fmt::format("inputs {} to {} of {} by the RMS of their maps",
                                          first + 1, last, order.size()));
    if (pages > max_pages && page + 1 == max_pages)
      options.caption.back() += "; the smaller ones are in influence.vtp";
    write_file(file, [&](const path& temporary) {
      render::write_sheet(temporary, influence.design, maps, options);
    });
  }
}

void write_sheets(const ResultFolder& folder, const PreparedStudy& ready, std::size_t arm) {
  const Study& study = ready.study;
  const InfluenceMap& influence = ready.influences[arm];
  const Eigen::MatrixXd all = effects(influence);
  const Eigen::VectorXd sd = spreads(study);
  PictureNames names;
  if (study.influence.sheet) write_pages(folder, ready, arm, all, sd, names);
  for (const std::string& name : study.influence.pictures)
    for (Index i = 0; i < all.rows(); ++i) {
      if (study.inputs[std::size_t(i)].name != name) continue;
      render::SheetOptions single = sheet_options(
          ready, arm, title_of(ready, arm, "what one standard deviation of an input does"));
      single.width = 1600;
      write_file(folder / (names.unused({"influence", name}) + ".png"), [&](const path& file) {
        render::write_sheet(file, influence.design, {effect_map(ready, influence, i, all, sd)},
                            single);
      });
    }
}

void write_influence_data(const ResultFolder& folder, const PreparedStudy& ready, std::size_t arm) {
  const InfluenceMap& influence = ready.influences[arm];
  const Eigen::MatrixXd all = effects(influence);
  std::vector<std::string> names{"base_um", "doubt_um", "rivals"};
  const Index n = influence.design.vertices.rows();
  Eigen::VectorXd competing_passes(n);
  for (Index v = 0; v < n; ++v)
    competing_passes[v] =
        double(influence.first[std::size_t(v) + 1] - influence.first[std::size_t(v)]);
  const Eigen::VectorXd base = maps(influence, influence.centre).col(0) - influence.error_free;
  const Eigen::VectorXd doubt = influence.doubt.array().isFinite().select(influence.doubt, NAN);
  std::vector<Eigen::VectorXd> arrays{base / units::um, doubt / units::um, competing_passes};
  for (Index i = 0; i < all.rows(); ++i) {
    const Input& one = ready.study.inputs[std::size_t(i)];
    names.push_back(one.name + (one.unit.empty() ? " um" : " um_per_" + one.unit));
    arrays.push_back(all.row(i).transpose() / units::um);
  }
  write_file(folder / "influence.vtp", [&](const path& file) {
    render::write_point_data(file, influence.design, names, arrays);
  });
}

void write_uncertainty(const ResultFolder& folder, const PreparedStudy& ready, std::size_t arm,
                       const UncertaintyMap& uncertainty) {
  const InfluenceMap& influence = ready.influences[arm];
  const Eigen::VectorXd sd = uncertainty.standard_deviation / units::um;
  const Eigen::VectorXd width = (uncertainty.high - uncertainty.low) / units::um;
  write_file(folder / "uncertainty.vtp", [&](const path& file) {
    render::write_point_data(file, influence.design,
                             {"standard_deviation_um", "low_um", "high_um", "drawn_um"},
                             {sd, uncertainty.low / units::um, uncertainty.high / units::um,
                              uncertainty.drawn / units::um});
  });
  const auto shown = [&](std::string title, const Eigen::VectorXd& values) {
    const cutting::Statistics found = statistics(influence.design, values);
    return render::SheetMap{std::move(title), figures("largest", found.rms, found.max), values, {}};
  };
  render::SheetOptions options =
      sheet_options(ready, arm, title_of(ready, arm, "how far the map is unknown"));
  options.values = "how far the surface is unknown along the design normal";
  options.columns = 2;
  write_file(folder / "uncertainty.png", [&](const path& file) {
    render::write_sheet(
        file, influence.design,
        {shown("standard deviation", sd),
         shown(fmt::format("width of the {:.3g} % band", 100.0 * uncertainty.confidence), width)},
        options);
  });
}

#endif

}  // namespace

ordered_json write_influence([[maybe_unused]] const ResultFolder& folder,
                             const PreparedStudy& ready, std::size_t arm) {
  const InfluenceMap& influence = ready.influences[arm];
  ordered_json json{{"influence",
                     {{"vertices", influence.design.vertices.rows()},
                      {"rivals", influence.distance.size()},
                      {"checks", ready.study.influence.checks},
                      {"flag_um", ready.study.influence.flag / units::um},
                      {"flagged_percent", ready.study.influence.checks > 0
                                              ? ordered_json(influence.flagged_percent)
                                              : ordered_json()}}}};
#if ABBE_RENDER
  write_influence_data(folder, ready, arm);
  write_sheets(folder, ready, arm);
#endif
  if (ready.study.uncertainty) {
    const UncertaintyMap uncertainty = uncertainty_map(ready.study, influence);
    json["uncertainty"] = to_json(influence, uncertainty);
#if ABBE_RENDER
    write_uncertainty(folder, ready, arm, uncertainty);
#endif
  }
  return json;
}

void write_histories(const ResultFolder& folder, [[maybe_unused]] const Study& study,
                     const std::vector<HistoryResult>& results) {
  write_table(folder / "histories.csv", to_csv(results));
#if ABBE_RENDER
  const auto place = [](std::vector<std::string>& names, const std::string& name) {
    const auto at = std::find(names.begin(), names.end(), name);
    if (at != names.end()) return Index(at - names.begin());
    names.push_back(name);
    return Index(names.size()) - 1;
  };
  const auto shown = [](const std::string& day) { return day.empty() ? "the scene's day" : day; };
  render::HeatMap map;
  for (const HistoryResult& one : results) {
    place(map.rows, shown(one.train));
    place(map.columns, shown(one.test));
  }
  map.values.setConstant(Index(map.rows.size()), Index(map.columns.size()), NAN);
  for (const HistoryResult& one : results)
    map.values(place(map.rows, shown(one.train)), place(map.columns, shown(one.test))) =
        one.compensated_rms / units::um;
  write_file(folder / "histories.png", [&](const path& file) {
    render::HeatMapOptions options;
    options.title = study.title + ": drift that is left";
    options.row_label = "learnt on";
    options.column_label = "judged on";
    options.value_label = "RMS / µm";
    render::write_heat_map(file, map, options);
  });
#endif
}

namespace {

constexpr std::size_t max_shown_machines = 20000;  // of one response

/// Reads the fields of a CSV file (RFC 4180) record by record.
class CsvRecords {
 public:
  explicit CsvRecords(const path& file) : file_(file), in_(file, std::ios::binary) {
    if (!in_) throw BadInput(file.string(), 0, 0, "a table that can be read", "none");
  }

  /// Reads the next record. Returns false at the end of the file.
  bool next(std::vector<std::string>& fields) {
    fields.assign(1, "");
    bool quoted = false, any = false;
    for (int c = in_.get(); c != EOF; c = in_.get()) {
      any = true;
      if (c == '"' && quoted && in_.peek() == '"')
        fields.back() += char(in_.get());
      else if (c == '"')
        quoted = !quoted;
      else if (c == ',' && !quoted)
        fields.emplace_back();
      else if (c == '\n' && !quoted)
        break;
      else if (c != '\r' || quoted)
        fields.back() += char(c);
    }
    if (any) ++number_;
    if (quoted) refuse("a quoted field that ends", "the end of the file");
    return any;
  }

  [[noreturn]] void refuse(const std::string& expected, const std::string& seen) const {
    throw BadInput(file_.string(), number_, 0, expected, seen);
  }

 private:
  path file_;
  std::ifstream in_;
  int number_ = 0;
};

/// Returns the responses of random machines; those without a response are left out.
MachineResponses machine_answers(const path& file, const std::vector<std::string>& heads) {
  CsvRecords records(file);
  std::vector<std::string> fields;
  if (!records.next(fields)) records.refuse("the head of a table of cases", "nothing");
  const std::vector<std::string> names = fields;
  const auto column = [&](const std::string& name) {
    const auto at = std::ranges::find(names, name);
    if (at == names.end()) records.refuse("a column " + name, "none of that name");
    return std::size_t(at - names.begin());
  };
  const std::size_t analysis = column("analysis");
  std::vector<std::size_t> at;
  for (const std::string& head : heads) at.push_back(column(head));
  MachineResponses answers;
  while (records.next(fields)) {
    if (fields.size() != names.size())
      records.refuse(fmt::format("{} fields", names.size()), std::to_string(fields.size()));
    if (fields[analysis] != "monte_carlo") continue;
    for (std::size_t k = 0; k < at.size(); ++k) {
      if (fields[at[k]].empty()) continue;
      const auto value = number_of(fields[at[k]]);
      if (!value) records.refuse("a number", in_quotes(fields[at[k]]));
      answers[heads[k]].push_back(*value);
    }
  }
  return answers;
}

/// Returns the values that the report shows: all, or every n-th by rank, which keeps the
/// distribution with its extremes.
std::vector<double> by_rank(std::vector<double> values) {
  if (values.size() <= max_shown_machines) return values;
  std::ranges::sort(values);
  std::vector<double> few;
  for (std::size_t k = 0; k < max_shown_machines; ++k)
    few.push_back(values[k * (values.size() - 1) / (max_shown_machines - 1)]);
  return few;
}

/// Returns the heads of the columns that hold random machines.
std::vector<std::string> heads_of(const ordered_json& budget) {
  std::vector<std::string> heads;
  if (!budget.contains("arms")) return heads;
  for (const ordered_json& arm : budget.at("arms"))
    for (const ordered_json& one : arm.at("responses"))
      if (!one.at("monte_carlo").is_null()) heads.push_back(response_column_head(budget, arm, one));
  return heads;
}

MachineResponses page_responses(const path& folder, const ordered_json& budget,
                                std::vector<std::string>& warnings) {
  const std::vector<std::string> heads = heads_of(budget);
  if (heads.empty()) return {};
  const path file = folder / "cases.csv";
  if (!std::filesystem::exists(file)) {
    warnings.push_back(
        "the distribution of random machines is left out of the report: the folder has no "
        "cases.csv");
    return {};
  }
  MachineResponses answers = machine_answers(file, heads);
  for (auto& [head, values] : answers) {
    const std::size_t all = values.size();
    values = by_rank(std::move(values));
    if (values.size() < all)
      warnings.push_back(
          fmt::format("of the {} random machines of {} the report holds {}, every "
                      "{:.3g}th by rank",
                      all, head, values.size(), double(all) / double(values.size())));
  }
  return answers;
}

/// Returns the pictures of maps in the folder and in those of its configurations, by name.
std::vector<path> map_pictures(const path& folder) {
  std::vector<path> files;
  const auto look = [&](const path& inside) {
    for (const auto& entry : std::filesystem::directory_iterator(inside)) {
      const std::string name = entry.path().filename().string();
      if (entry.is_regular_file() && name.ends_with(".png") &&
          (name.starts_with("influence") || name == "uncertainty.png"))
        files.push_back(entry.path());
    }
  };
  look(folder);
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_directory()) look(entry.path());
  std::ranges::sort(files);
  return files;
}

std::string plain_text(const ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

void add_requested(FiguresPage& page, const ordered_json& budget, const path& folder) {
  page.asked.push_back({"study", page.title});
  for (const char* key : {"engine", "seed", "cases", "failed_cases"})
    if (budget.contains(key))
      page.asked.push_back({"study_" + std::string(key), plain_text(budget.at(key))});
  if (budget.contains("inputs"))
    page.asked.push_back({"study_inputs", std::to_string(budget.at("inputs").size())});
  page.asked.push_back({"folder", std::filesystem::absolute(folder).lexically_normal().string()});
}

/// Returns true if a configuration of the budget uses a variant of the scene.
bool has_variants(const ordered_json& budget) {
  if (!budget.contains("arms")) return true;
  return std::ranges::any_of(budget.at("arms"), [](const ordered_json& arm) {
    return !arm.at("variant").get<std::string>().empty();
  });
}

/// Adds the files and the command that uses them. A scene with variants is not packed, because the
/// saved scene holds one variant only.
void add_files(FiguresPage& page, const ordered_json& budget, const path& folder) {
  for (const char* name : {"study.toml", "scene.toml", "budget.json", "budget.csv", "budget.md"})
    if (std::filesystem::exists(folder / name))
      page.files.push_back({name, read_text(folder / name, max_saved_bytes)});
  const bool has_scene = std::filesystem::exists(folder / "scene.toml") && !has_variants(budget);
  page.command = std::string("abbe study study.toml") +
                 (has_scene ? " --set scene=scene.toml" : "") + " --report";
}

void add_warnings(FiguresPage& page, const ordered_json& budget, const path& folder) {
  if (budget.contains("warnings"))
    for (const ordered_json& one : budget.at("warnings"))
      page.warnings.push_back(one.get<std::string>());
  if (budget.contains("histories"))
    for (const ordered_json& one : budget.at("histories"))
      for (const ordered_json& warning : one.at("warnings"))
        page.warnings.push_back(warning.get<std::string>());
  const Mark mark = read_manifest(folder);
  if (!writing_command(mark, folder / "budget.json"))
    page.warnings.push_back(
        "budget.json is not as abbe study wrote it, or the mark of its folder is missing");
}

HtmlReport page_of_budget(const ordered_json& budget, const path& folder,
                          const std::string& language) {
  if (!budget.is_object() || !(budget.contains("arms") || budget.contains("histories")))
    throw std::invalid_argument("JSON of something else");
  HtmlReport report;
  FiguresPage page;
  page.language = language;
  page.title = budget.contains("study") ? budget.at("study").get<std::string>()
                                        : std::filesystem::absolute(folder).filename().string();
  page.blocks = study_blocks(budget, page_responses(folder, budget, report.warnings));
  ordered_json maps =
      pictures_block("influence-maps", label_text("influence_maps"), folder, map_pictures(folder));
  if (!maps.is_null()) {
    maps["note"] = label_text("influence_maps_note");
    page.blocks.insert(
        page.blocks.begin() + std::ptrdiff_t(std::min<std::size_t>(page.blocks.size(), 2)), maps);
  }
  add_requested(page, budget, folder);
  add_warnings(page, budget, folder);
  page.warnings.insert(page.warnings.end(), report.warnings.begin(), report.warnings.end());
  add_files(page, budget, folder);
  report.html = page_html(page);
  return report;
}

}  // namespace

bool has_study(const path& folder) { return std::filesystem::exists(folder / "budget.json"); }

HtmlReport study_page(const path& folder, const std::string& language) {
  const path file = folder / "budget.json";
  if (!std::filesystem::exists(file))
    throw BadInput(folder.string(), 0, 0, "the folder of a finished study, with its budget.json",
                   "none of that name");
  HtmlReport report;
  read_saved_json(file, "the budget of a study as abbe study writes it, with arms or histories",
                  [&](const ordered_json& budget, const std::string&) {
                    report = page_of_budget(budget, folder, language);
                  });
  return report;
}

}  // namespace abbe::sim::study
