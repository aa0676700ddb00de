#include "render/map_text.h"

#include <cmath>

#include <fmt/format.h>

#include "render/label.h"
#include "render/layout.h"

namespace abbe::render {

std::string figures_text(const Figures& figures, Mean mean) {
  const LengthUnit unit = unit_for(std::isfinite(figures.pv_um) ? figures.pv_um : 0.0);
  std::vector<std::string> parts;
  const auto add = [&](const char* name, double um, int decimals) {
    constexpr double least_um = 1e-6;  // below it figures are those of rounding
    const std::string length =
        um < least_um ? "under 0.001 nm"
                      : fmt::format("{} {}", fixed(um * unit.per_um, decimals), unit.name);
    parts.push_back(fmt::format("{} {}", name, length));
  };
  const int rms_decimals = figure_decimals(figures.rms_um * unit.per_um);
  if (std::isfinite(figures.pv_um)) {
    add("PV", figures.pv_um, figure_decimals(figures.pv_um * unit.per_um));
  }
  if (std::isfinite(figures.rms_um)) add("RMS", figures.rms_um, rms_decimals);
  if (std::isfinite(figures.mean_um) && mean == Mean::Stated) {
    // no more digits than the RMS has: a mean near zero is rounding
    parts.push_back(fmt::format(
        "mean {} {}", signed_fixed(figures.mean_um * unit.per_um, rms_decimals), unit.name));
  }
  return parts.empty() ? "nothing was cut" : fmt::format("{}", fmt::join(parts, "    "));
}

std::string beyond_text(const Tally& counts, double range_um) {
  if (counts.beyond == 0) return {};
  const LengthUnit unit = unit_for(range_um);
  const double percent =
      100.0 * static_cast<double>(counts.beyond) / static_cast<double>(counts.cut);
  return fmt::format("{} % of the cut vertices lie beyond the scale; values from {} to {} {}",
                     percent < 0.01 ? "less than 0.01" : figure(percent),
                     figure(counts.lowest_um * unit.per_um),
                     figure(counts.highest_um * unit.per_um), unit.name);
}

std::vector<std::string> left_out_text(const Tally& counts) {
  std::vector<std::string> parts;
  if (counts.uncut > 0)
    parts.push_back(fmt::format("{} uncut ({:.3g} %)", grouped(counts.uncut),
                                100.0 * double(counts.uncut) / double(counts.judged())));
  if (counts.gouged > 0)
    parts.push_back(fmt::format("{} gouged deeper than the band", grouped(counts.gouged)));
  return parts;
}

std::optional<Span> common_limits(const cutting::ToleranceBands& tolerance_um) {
  if (tolerance_um.rows() == 0) return std::nullopt;
  const Eigen::RowVector2d first = tolerance_um.row(0);
  if (!first.allFinite() || (tolerance_um.rowwise() - first).cwiseAbs().maxCoeff() > 0.0)
    return std::nullopt;
  return Span{first[0], first[1]};
}

std::string limits_text(const cutting::ToleranceBands& tolerance_um) {
  const auto common = common_limits(tolerance_um);
  if (!common) return "by region";
  const LengthUnit unit = unit_for(std::max(std::abs(common->lower), std::abs(common->upper)));
  const auto end = [&](double um) {
    return fmt::format("{}{:.4g}",
                       um < 0.0   ? "−"
                       : um > 0.0 ? "+"
                                  : "",
                       std::abs(um * unit.per_um));
  };
  return fmt::format("{} to {} {}", end(common->lower), end(common->upper), unit.name);
}

std::string verdict_text(const MapPicture& picture) {
  const ToleranceShares s =
      picture.shares.value_or(tolerance_shares(picture.field, picture.tolerance_um));
  std::string text = picture.verdict.empty() ? "" : picture.verdict + "  ·  ";
  text += percent_text(s.in) + " of the area in tolerance";
  for (const auto& [name, percent] :
       {std::pair{"over", s.over}, {"under", s.under}, {"uncut", s.uncut}})
    if (percent > 0.0) text += fmt::format(", {} {}", name, percent_text(percent));
  return text;
}

std::vector<std::string> map_text(const MapPicture& picture, const Tally& counts, double range_um,
                                  const std::string& view) {
  std::vector<std::string> lines{sign_convention};
  if (picture.tolerance_um.rows() > 0)
    lines.push_back(fmt::format("tolerance {}  ·  {}", limits_text(picture.tolerance_um),
                                verdict_text(picture)));
  std::string numbers = fmt::format("{} vertices, ", grouped(counts.vertices()));
  const std::vector<std::string> left_out = left_out_text(counts);
  numbers += left_out.empty() ? "0 uncut" : fmt::format("{}", fmt::join(left_out, ", "));
  if (counts.outside > 0) numbers += fmt::format(", {} outside", grouped(counts.outside));
  lines.push_back(fmt::format("datum {}  ·  alignment {}  ·  view {}  ·  {}", picture.datum,
                              picture.alignment, view, numbers));
  if (const std::string beyond = beyond_text(counts, range_um); !beyond.empty()) {
    lines.push_back(beyond);
  }
  lines.insert(lines.end(), picture.caption.begin(), picture.caption.end());
  return lines;
}

}  // namespace abbe::render
