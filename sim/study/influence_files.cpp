#include "sim/study/influence_files.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include <fmt/format.h>

#include "cutting/residual.h"
#include "kinematics/units.h"
#include "sim/files/output.h"
#include "sim/study/picture_names.h"
#include "sim/study/uncertainty.h"
#include "sim/study/words.h"

#if ABBE_RENDER
#include "render/heat_map.h"
#include "render/point_data.h"
#include "render/sheet.h"
#endif

namespace abbe::sim::study {
namespace {

using Eigen::Index;
using nlohmann::ordered_json;
using std::filesystem::path;

#if ABBE_RENDER

constexpr std::size_t maps_on_a_page = 30, most_pages = 8;

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

std::string title_of(const ReadyStudy& ready, std::size_t arm, const char* what) {
  return fmt::format("{}, {}: {}", ready.study.title, ready.study.arms[arm].name, what);
}

/// The map of one standard deviation of an input.
render::SheetMap effect_map(const ReadyStudy& ready, const InfluenceMap& influence, Index input,
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

render::SheetOptions sheet_options(const ReadyStudy& ready, std::size_t arm, std::string title) {
  const Scene& scene = ready.arms[arm].job.scene;
  render::SheetOptions options;
  options.title = std::move(title);
  options.from = scene.view.from;
  options.up = scene.view.up;
  return options;
}

/// Inputs by the RMS of what one standard deviation of them does, the largest first; of equal ones
/// the first.
std::vector<Index> by_size(const InfluenceMap& influence, const Eigen::MatrixXd& all,
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

/// Pages of maps, as many as can be looked at on each; those of an earlier study go.
void write_pages(const ResultFolder& folder, const ReadyStudy& ready, std::size_t arm,
                 const Eigen::MatrixXd& all, const Eigen::VectorXd& sd, PictureNames& names) {
  const InfluenceMap& influence = ready.influences[arm];
  const std::vector<Index> order = by_size(influence, all, sd);
  const std::size_t pages = (order.size() + maps_on_a_page - 1) / maps_on_a_page;
  for (std::size_t page = 0; page < most_pages; ++page) {
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
    if (pages > most_pages && page + 1 == most_pages)
      options.caption.back() += "; the smaller ones are in influence.vtp";
    write_file(file, [&](const path& temporary) {
      render::write_sheet(temporary, influence.design, maps, options);
    });
  }
}

void write_sheets(const ResultFolder& folder, const ReadyStudy& ready, std::size_t arm) {
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

void write_influence_data(const ResultFolder& folder, const ReadyStudy& ready, std::size_t arm) {
  const InfluenceMap& influence = ready.influences[arm];
  const Eigen::MatrixXd all = effects(influence);
  std::vector<std::string> names{"base_um", "doubt_um", "rivals"};
  const Index n = influence.design.vertices.rows();
  Eigen::VectorXd rivals(n);
  for (Index v = 0; v < n; ++v)
    rivals[v] = double(influence.first[std::size_t(v) + 1] - influence.first[std::size_t(v)]);
  const Eigen::VectorXd base = maps(influence, influence.centre).col(0) - influence.error_free;
  const Eigen::VectorXd doubt = influence.doubt.array().isFinite().select(influence.doubt, NAN);
  std::vector<Eigen::VectorXd> arrays{base / units::um, doubt / units::um, rivals};
  for (Index i = 0; i < all.rows(); ++i) {
    const Input& one = ready.study.inputs[std::size_t(i)];
    names.push_back(one.name + (one.unit.empty() ? " um" : " um_per_" + one.unit));
    arrays.push_back(all.row(i).transpose() / units::um);
  }
  write_file(folder / "influence.vtp", [&](const path& file) {
    render::write_point_data(file, influence.design, names, arrays);
  });
}

void write_uncertainty(const ResultFolder& folder, const ReadyStudy& ready, std::size_t arm,
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

ordered_json write_influence([[maybe_unused]] const ResultFolder& folder, const ReadyStudy& ready,
                             std::size_t arm) {
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

}  // namespace abbe::sim::study
