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

constexpr std::size_t maps_per_page = 30, max_pages = 8;

/// Returns the statistics of a map; NaN where not cut.
cutting::Statistics map_statistics(const cutting::Design& design, const Eigen::VectorXd& map_um) {
  const Index n = map_um.size();
  cutting::Surface surface{map_um, Eigen::VectorXd::Zero(n), std::vector<int>(std::size_t(n)), {}};
  for (const double value : map_um)
    surface.status.push_back(std::isfinite(value) ? cutting::VertexStatus::Cut
                                                  : cutting::VertexStatus::Uncut);
  return cutting::statistics(surface, design);
}

/// Returns the RMS and another figure of a map, um.
/// @param name  of the other figure
std::string figures_text(const char* name, std::optional<double> rms, std::optional<double> other) {
  return rms && other ? fmt::format("RMS {:.3g} µm   {} {:.3g} µm", *rms, name, *other)
                      : "no vertices cut";
}

std::string sheet_title(const PreparedStudy& ready, std::size_t configuration,
                        const char* contents) {
  return fmt::format("{}, {}: {}", ready.study.title,
                     ready.study.configurations[configuration].name, contents);
}

/// Returns the map of the effect of one standard deviation of an input.
/// @param input_effects  (inputs x n) effects of all inputs
/// @param sd             (inputs) standard deviations
render::SheetMap effect_map(const PreparedStudy& ready, const InfluenceMap& influence, Index index,
                            const Eigen::MatrixXd& input_effects, const Eigen::VectorXd& sd) {
  const Input& input = ready.study.inputs[std::size_t(index)];
  render::SheetMap map;
  map.title = input.unit.empty()
                  ? input.name
                  : fmt::format("{}, {:.3g} {}", input.name, sd[index], display_unit(input.unit));
  map.values_um = input_effects.row(index).transpose() * (sd[index] / units::um);
  const cutting::Statistics figures = map_statistics(influence.design, map.values_um);
  map.figures = figures_text("PV", figures.rms, figures.pv);
  return map;
}

/// Returns the options of a sheet with the view of the configuration's scene.
render::SheetOptions sheet_options(const PreparedStudy& ready, std::size_t configuration,
                                   std::string title) {
  const Scene& scene = ready.configurations[configuration].job.scene;
  render::SheetOptions options;
  options.title = std::move(title);
  options.from = scene.view.from;
  options.up = scene.view.up;
  return options;
}

/// Returns the inputs sorted by the RMS of the effect of one standard deviation, largest first;
/// ties keep their order.
std::vector<Index> inputs_by_effect(const InfluenceMap& influence,
                                    const Eigen::MatrixXd& input_effects,
                                    const Eigen::VectorXd& sd) {
  std::vector<double> rms;
  for (Index i = 0; i < input_effects.rows(); ++i)
    rms.push_back(map_statistics(influence.design, input_effects.row(i).transpose() * sd[i])
                      .rms.value_or(0.0));
  std::vector<Index> order(std::size_t(input_effects.rows()));
  std::iota(order.begin(), order.end(), Index(0));
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return rms[std::size_t(a)] > rms[std::size_t(b)]; });
  return order;
}

/// Writes the sheets of all inputs. Those of an earlier study with more inputs are removed.
void write_pages(const ResultFolder& folder, const PreparedStudy& ready, std::size_t configuration,
                 const Eigen::MatrixXd& input_effects, const Eigen::VectorXd& sd,
                 PictureNames& names) {
  const InfluenceMap& influence = ready.influences[configuration];
  const std::vector<Index> order = inputs_by_effect(influence, input_effects, sd);
  const std::size_t pages = (order.size() + maps_per_page - 1) / maps_per_page;
  for (std::size_t page = 0; page < max_pages; ++page) {
    std::vector<std::string> name{"influence", "sheet"};
    if (page > 0) name.push_back(std::to_string(page + 1));
    const ResultFile file = folder / (names.unique_name(name) + ".png");
    if (page >= pages) {
      if (page > 0) remove_file(file);
      continue;
    }
    const std::size_t first = page * maps_per_page,
                      last = std::min(order.size(), first + maps_per_page);
    std::vector<render::SheetMap> maps;
    for (std::size_t k = first; k < last; ++k)
      maps.push_back(effect_map(ready, influence, order[k], input_effects, sd));
    render::SheetOptions options = sheet_options(
        ready, configuration,
        sheet_title(ready, configuration, "effect of one standard deviation of each input"));
    options.caption.push_back(fmt::format("inputs {} to {} of {} by the RMS of their maps",
                                          first + 1, last, order.size()));
    if (pages > max_pages && page + 1 == max_pages)
      options.caption.back() += "; the smaller ones are in influence.vtp";
    write_file(file, [&](const path& temporary) {
      render::write_sheet(temporary, influence.design, maps, options);
    });
  }
}

/// Writes the sheets of all inputs and the pictures of single inputs.
void write_effect_pictures(const ResultFolder& folder, const PreparedStudy& ready,
                           std::size_t configuration) {
  const Study& study = ready.study;
  const InfluenceMap& influence = ready.influences[configuration];
  const Eigen::MatrixXd input_effects = effects(influence);
  const Eigen::VectorXd sd = spreads(study);
  PictureNames names;
  if (study.influence.has_overview_sheet)
    write_pages(folder, ready, configuration, input_effects, sd, names);
  for (const std::string& name : study.influence.pictures)
    for (Index i = 0; i < input_effects.rows(); ++i) {
      if (study.inputs[std::size_t(i)].name != name) continue;
      render::SheetOptions single = sheet_options(
          ready, configuration,
          sheet_title(ready, configuration, "effect of one standard deviation of an input"));
      single.width = 1600;
      write_file(folder / (names.unique_name({"influence", name}) + ".png"), [&](const path& file) {
        render::write_sheet(file, influence.design,
                            {effect_map(ready, influence, i, input_effects, sd)}, single);
      });
    }
}

/// Writes influence.vtp.
void write_influence_data(const ResultFolder& folder, const PreparedStudy& ready,
                          std::size_t configuration) {
  const InfluenceMap& influence = ready.influences[configuration];
  const Eigen::MatrixXd input_effects = effects(influence);
  std::vector<std::string> names{"base_um", "doubt_um", "rivals"};
  const Index n = influence.design.vertices.rows();
  Eigen::VectorXd pass_counts(n);
  for (Index v = 0; v < n; ++v)
    pass_counts[v] = double(influence.first[std::size_t(v) + 1] - influence.first[std::size_t(v)]);
  const Eigen::VectorXd base = maps(influence, influence.centre).col(0) - influence.error_free;
  const Eigen::VectorXd max_error =
      influence.max_error.array().isFinite().select(influence.max_error, NAN);
  std::vector<Eigen::VectorXd> arrays{base / units::um, max_error / units::um, pass_counts};
  for (Index i = 0; i < input_effects.rows(); ++i) {
    const Input& input = ready.study.inputs[std::size_t(i)];
    names.push_back(input.name + (input.unit.empty() ? " um" : " um_per_" + input.unit));
    arrays.push_back(input_effects.row(i).transpose() / units::um);
  }
  write_file(folder / "influence.vtp", [&](const path& file) {
    render::write_point_data(file, influence.design, names, arrays);
  });
}

/// Writes uncertainty.vtp and uncertainty.png.
void write_uncertainty(const ResultFolder& folder, const PreparedStudy& ready,
                       std::size_t configuration, const UncertaintyMap& uncertainty) {
  const InfluenceMap& influence = ready.influences[configuration];
  const Eigen::VectorXd sd = uncertainty.standard_deviation / units::um;
  const Eigen::VectorXd width = (uncertainty.high - uncertainty.low) / units::um;
  write_file(folder / "uncertainty.vtp", [&](const path& file) {
    render::write_point_data(file, influence.design,
                             {"standard_deviation_um", "low_um", "high_um", "drawn_um"},
                             {sd, uncertainty.low / units::um, uncertainty.high / units::um,
                              uncertainty.drawn / units::um});
  });
  const auto sheet_map = [&](std::string title, const Eigen::VectorXd& values) {
    const cutting::Statistics figures = map_statistics(influence.design, values);
    return render::SheetMap{
        std::move(title), figures_text("largest", figures.rms, figures.max), values, {}};
  };
  render::SheetOptions options = sheet_options(
      ready, configuration, sheet_title(ready, configuration, "uncertainty of the map"));
  options.values = "uncertainty of the surface along the design normal";
  options.columns = 2;
  write_file(folder / "uncertainty.png", [&](const path& file) {
    render::write_sheet(file, influence.design,
                        {sheet_map("standard deviation", sd),
                         sheet_map(fmt::format("width of the {:.3g} % confidence interval",
                                               100.0 * uncertainty.confidence),
                                   width)},
                        options);
  });
}

#endif

}  // namespace

ordered_json write_influence([[maybe_unused]] const ResultFolder& folder,
                             const PreparedStudy& ready, std::size_t configuration) {
  const InfluenceMap& influence = ready.influences[configuration];
  ordered_json json{{"influence",
                     {{"vertices", influence.design.vertices.rows()},
                      {"rivals", influence.distance.size()},
                      {"checks", ready.study.influence.checks},
                      {"flag_um", ready.study.influence.flag_threshold / units::um},
                      {"flagged_percent", ready.study.influence.checks > 0
                                              ? ordered_json(influence.flagged_percent)
                                              : ordered_json()}}}};
#if ABBE_RENDER
  write_influence_data(folder, ready, configuration);
  write_effect_pictures(folder, ready, configuration);
#endif
  if (ready.study.uncertainty) {
    const UncertaintyMap uncertainty = uncertainty_map(ready.study, influence);
    json["uncertainty"] = to_json(influence, uncertainty);
#if ABBE_RENDER
    write_uncertainty(folder, ready, configuration, uncertainty);
#endif
  }
  return json;
}

void write_histories(const ResultFolder& folder, [[maybe_unused]] const Study& study,
                     const std::vector<HistoryResult>& results) {
  write_table(folder / "histories.csv", to_csv(results));
#if ABBE_RENDER
  // Returns the index of a name, which is appended if it is new.
  const auto name_index = [](std::vector<std::string>& names, const std::string& name) {
    const auto match = std::find(names.begin(), names.end(), name);
    if (match != names.end()) return Index(match - names.begin());
    names.push_back(name);
    return Index(names.size()) - 1;
  };
  const auto day_label = [](const std::string& day) {
    return day.empty() ? "day of the scene" : day;
  };
  render::HeatMap map;
  for (const HistoryResult& result : results) {
    name_index(map.rows, day_label(result.train));
    name_index(map.columns, day_label(result.test));
  }
  map.values.setConstant(Index(map.rows.size()), Index(map.columns.size()), NAN);
  for (const HistoryResult& result : results)
    map.values(name_index(map.rows, day_label(result.train)),
               name_index(map.columns, day_label(result.test))) =
        result.compensated_rms / units::um;
  write_file(folder / "histories.png", [&](const path& file) {
    render::HeatMapOptions options;
    options.title = study.title + ": remaining drift";
    options.row_label = "learnt on";
    options.column_label = "evaluated on";
    options.value_label = "RMS / µm";
    render::write_heat_map(file, map, options);
  });
#endif
}

namespace {

constexpr std::size_t max_shown_machines = 20000;  // of one response

/// Reads a CSV file (RFC 4180) record by record.
class CsvReader {
 public:
  explicit CsvReader(const path& file) : file_(file), in_(file, std::ios::binary) {
    if (!in_) throw BadInput(file.string(), 0, 0, "a readable table", "none");
  }

  /// Returns the fields of the next record; empty at the end of the file.
  std::optional<std::vector<std::string>> next() {
    std::vector<std::string> fields(1);
    bool is_quoted = false, has_bytes = false;
    for (int c = in_.get(); c != EOF; c = in_.get()) {
      has_bytes = true;
      if (c == '"' && is_quoted && in_.peek() == '"')
        fields.back() += char(in_.get());
      else if (c == '"')
        is_quoted = !is_quoted;
      else if (c == ',' && !is_quoted)
        fields.emplace_back();
      else if (c == '\n' && !is_quoted)
        break;
      else if (c != '\r' || is_quoted)
        fields.back() += char(c);
    }
    if (!has_bytes) return std::nullopt;
    ++number_;
    if (is_quoted) throw_bad_input("a closing quote", "the end of the file");
    return fields;
  }

  /// Throws BadInput at the current record.
  [[noreturn]] void throw_bad_input(const std::string& expected, const std::string& seen) const {
    throw BadInput(file_.string(), number_, 0, expected, seen);
  }

 private:
  path file_;
  std::ifstream in_;
  int number_ = 0;  ///< of the current record, from 1
};

/// Returns the responses of random machines. Machines without a response are left out.
/// @param heads  headings of the columns
MachineResponses read_responses(const path& file, const std::vector<std::string>& heads) {
  CsvReader reader(file);
  const auto names = reader.next();
  if (!names) reader.throw_bad_input("the header of a table of cases", "nothing");
  const auto column = [&](const std::string& name) {
    const auto match = std::ranges::find(*names, name);
    if (match == names->end()) reader.throw_bad_input("a column " + name, "no such column");
    return std::size_t(match - names->begin());
  };
  const std::size_t analysis = column("analysis");
  std::vector<std::size_t> columns;
  for (const std::string& head : heads) columns.push_back(column(head));
  MachineResponses responses;
  while (const auto fields = reader.next()) {
    if (fields->size() != names->size())
      reader.throw_bad_input(fmt::format("{} fields", names->size()),
                             std::to_string(fields->size()));
    if ((*fields)[analysis] != "monte_carlo") continue;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const std::string& field = (*fields)[columns[k]];
      if (field.empty()) continue;
      const auto value = number_of(field);
      if (!value) reader.throw_bad_input("a number", quoted_excerpt(field));
      responses[heads[k]].push_back(*value);
    }
  }
  return responses;
}

/// Returns the values that the report shows: all of them, or every n-th by rank, which preserves
/// the distribution and its extremes.
std::vector<double> shown_values(std::vector<double> values) {
  if (values.size() <= max_shown_machines) return values;
  std::ranges::sort(values);
  std::vector<double> subset;
  for (std::size_t k = 0; k < max_shown_machines; ++k)
    subset.push_back(values[k * (values.size() - 1) / (max_shown_machines - 1)]);
  return subset;
}

/// Returns the headings of the columns with responses of random machines.
std::vector<std::string> response_column_heads(const ordered_json& budget) {
  std::vector<std::string> heads;
  if (!budget.contains("arms")) return heads;
  for (const ordered_json& configuration : budget.at("arms"))
    for (const ordered_json& response : configuration.at("responses"))
      if (!response.at("monte_carlo").is_null())
        heads.push_back(response_column_head(budget, configuration, response));
  return heads;
}

/// Returns the responses of random machines for the page. Appends warnings about omissions.
MachineResponses page_responses(const path& folder, const ordered_json& budget,
                                std::vector<std::string>& warnings) {
  const std::vector<std::string> heads = response_column_heads(budget);
  if (heads.empty()) return {};
  const path file = folder / "cases.csv";
  if (!std::filesystem::exists(file)) {
    warnings.push_back(
        "the distribution of random machines is omitted from the report: the folder has no "
        "cases.csv");
    return {};
  }
  MachineResponses responses = read_responses(file, heads);
  for (auto& [head, values] : responses) {
    const std::size_t count = values.size();
    values = shown_values(std::move(values));
    if (values.size() < count)
      warnings.push_back(
          fmt::format("of {} random machines of {} the report shows {}, every {:.3g}th by rank",
                      count, head, values.size(), double(count) / double(values.size())));
  }
  return responses;
}

/// Returns the pictures of maps in the folder and in the folders of its configurations, sorted by
/// name.
std::vector<path> map_pictures(const path& folder) {
  std::vector<path> files;
  const auto add_pictures = [&](const path& subfolder) {
    for (const auto& entry : std::filesystem::directory_iterator(subfolder)) {
      const std::string name = entry.path().filename().string();
      if (entry.is_regular_file() && name.ends_with(".png") &&
          (name.starts_with("influence") || name == "uncertainty.png"))
        files.push_back(entry.path());
    }
  };
  add_pictures(folder);
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_directory()) add_pictures(entry.path());
  std::ranges::sort(files);
  return files;
}

std::string plain_text(const ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

/// Adds the request to the page: study, engine, seed, numbers of cases and inputs, folder.
void add_request(FiguresPage& page, const ordered_json& budget, const path& folder) {
  page.request.push_back({"study", page.title});
  for (const char* key : {"engine", "seed", "cases", "failed_cases"})
    if (budget.contains(key))
      page.request.push_back({"study_" + std::string(key), plain_text(budget.at(key))});
  if (budget.contains("inputs"))
    page.request.push_back({"study_inputs", std::to_string(budget.at("inputs").size())});
  page.request.push_back({"folder", std::filesystem::absolute(folder).lexically_normal().string()});
}

/// Returns true if the budget has a configuration of a variant of the scene, or none at all.
bool has_variants(const ordered_json& budget) {
  if (!budget.contains("arms")) return true;
  return std::ranges::any_of(budget.at("arms"), [](const ordered_json& configuration) {
    return !configuration.at("variant").get<std::string>().empty();
  });
}

/// Adds the files for download and the command that uses them. The command uses the saved scene
/// only without variants, because a saved scene has a single variant.
void add_files(FiguresPage& page, const ordered_json& budget, const path& folder) {
  for (const char* name : {"study.toml", "scene.toml", "budget.json", "budget.csv", "budget.md"})
    if (std::filesystem::exists(folder / name))
      page.files.push_back({name, read_text(folder / name, max_saved_bytes)});
  const bool has_scene = std::filesystem::exists(folder / "scene.toml") && !has_variants(budget);
  page.command = std::string("abbe study study.toml") +
                 (has_scene ? " --set scene=scene.toml" : "") + " --report";
}

/// Adds the warnings of the budget, and one if budget.json was changed after it was written.
void add_warnings(FiguresPage& page, const ordered_json& budget, const path& folder) {
  if (budget.contains("warnings"))
    for (const ordered_json& warning : budget.at("warnings"))
      page.warnings.push_back(warning.get<std::string>());
  if (budget.contains("histories"))
    for (const ordered_json& result : budget.at("histories"))
      for (const ordered_json& warning : result.at("warnings"))
        page.warnings.push_back(warning.get<std::string>());
  const Manifest mark = read_manifest(folder);
  if (!writing_command(mark, folder / "budget.json"))
    page.warnings.push_back(
        "budget.json was changed after abbe study wrote it, or the manifest of its folder is "
        "missing");
}

/// Returns the page of a budget.
/// @throws std::invalid_argument if it is not the budget of a study
HtmlReport budget_page(const ordered_json& budget, const path& folder,
                       const std::string& language) {
  if (!budget.is_object() || !(budget.contains("arms") || budget.contains("histories")))
    throw std::invalid_argument("JSON of another kind");
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
  add_request(page, budget, folder);
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
                   "no such column");
  HtmlReport report;
  read_saved_json(file, "the budget of a study written by abbe study, with arms or histories",
                  [&](const ordered_json& budget, const std::string&) {
                    report = budget_page(budget, folder, language);
                  });
  return report;
}

}  // namespace abbe::sim::study
