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

}  // namespace

FiguresPage with_folder(FiguresPage page, const path& folder) {
  ordered_json maps =
      pictures_block("influence-maps", label_text("influence_maps"), folder, map_pictures(folder));
  if (!maps.is_null()) {
    maps["note"] = label_text("influence_maps_note");
    page.blocks.insert(
        page.blocks.begin() + std::ptrdiff_t(std::min<std::size_t>(page.blocks.size(), 2)), maps);
  }
  page.request.push_back({"folder", std::filesystem::absolute(folder).lexically_normal().string()});
  page.files = page_files({folder / "study.toml", folder / "scene.toml", folder / "budget.json",
                           folder / "budget.csv", folder / "budget.md"});
  return page;
}

bool has_study(const path& folder) { return std::filesystem::exists(folder / "budget.json"); }

FiguresPage saved_study_page(const path& folder) {
  return with_folder(read_page(folder / "page.json", {folder / "budget.json"}), folder);
}

}  // namespace abbe::sim::study
