#include "sim/cut/program_warnings.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/cut/tool_comments.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/unreached_text.h"
#include "sim/scene/scene_tool_forms.h"
#include "sim/scene/scene_tools.h"

namespace abbe::sim {
namespace {

/// A mesh whose facets sag by more than the tolerance, or that has hardly a smooth place.
std::string coarse_text(const Scene& scene, const cutting::Design& design_w) {
  if (!std::holds_alternative<MeshFile>(scene.part.shape)) return {};
  const cutting::Coarseness coarse = cutting::coarseness(design_w);
  if (2 * coarse.sharp > coarse.judged)
    return fmt::format(
        "the mesh is too coarse to be judged: {} of {} judged vertices lie on edges of more than "
        "30 "
        "degrees, where a normal is a mean of faces",
        coarse.sharp, coarse.judged);
  const std::optional<double> half = narrowest_half_width(scene.part);
  if (half && coarse.facet_error > *half)
    return fmt::format(
        "the mesh is too coarse for the tolerance: between judged vertices its facets sag by up to "
        "{:.4g} um, the tolerance is ±{:.4g} um",
        coarse.facet_error / units::um, *half / units::um);
  return {};
}

bool is_judged(const cutting::Design& design, Eigen::Index vertex) {
  return design.judged.empty() || design.judged[std::size_t(vertex)] != 0;
}

/// A design on which a gouge can lie between the places where it is judged.
std::string sparse_text(const Scene& scene, const cutting::Design& design_w) {
  const JudgedPlaces places = judged_places(design_w);
  if (!is_sparse(places, scene.tool)) return {};
  if (places.vertices < least_judged)
    return fmt::format("the part is judged at {} {} only: what is cut between them is in no figure",
                       places.vertices, places.vertices == 1 ? "vertex" : "vertices");
  return fmt::format(
      "judged vertices that an edge joins are up to {:.4g} mm apart, the cutter is {:.4g} mm wide: "
      "a gouge between them is in no figure",
      places.apart, 2.0 * std::get<cutting::Cutter>(scene.tool.nominal).radius);
}

std::string no_feed_text(const program::Path& path) {
  const bool feeds = std::any_of(path.blocks.begin(), path.blocks.end(), program::is_feed);
  if (feeds || path.motion_blocks == 0) return {};
  return fmt::format("no block of the program feeds: all {} that move are rapids",
                     path.motion_blocks);
}

/// A program that counts in two units, or says two.
std::string unit_change_text(const program::Path& path) {
  if (path.unit_words.size() < 2) return {};
  int inches = 0, moves = 0;
  for (const program::Block& block : path.blocks) {
    if (block.interpolation == program::Interpolation::Dwell) continue;
    ++moves;
    inches += block.inch;
  }
  std::string words;
  for (std::size_t i = 0; i < std::min<std::size_t>(path.unit_words.size(), 4); ++i) {
    const program::UnitWord& word = path.unit_words[i];
    words +=
        fmt::format("{}{} on line {}", i == 0 ? "" : ", ", word.inch ? "G20" : "G21", word.line);
  }
  return fmt::format(
      "the program says two units, {}: {} of its {} moves count in inches, the others in mm; take "
      "the wrong word out",
      words, inches, moves);
}

/// A holder that stands where the cutter or the spindle is, or that leaves a piece of the tool out.
void add_holder_texts(const ToolDescription& tool, std::vector<std::string>& texts) {
  const auto* cutter = std::get_if<cutting::Cutter>(&tool.actual);
  if (cutter == nullptr || !tool.holder) return;
  constexpr double least = 0.01;  // mm
  const double begin = (*tool.holder)(0, 1), end = (*tool.holder)(tool.holder->rows() - 1, 1);
  const std::string whose = tool.number ? fmt::format(" of tool {}", *tool.number) : "";
  if (const double under = cutter->flank_length - begin; under > least)
    texts.push_back(fmt::format(
        "the holder{} begins {:.6g} mm above the tip, {:.6g} mm below the upper end of the flank "
        "(flank_length_mm {:.6g}): that much of the cutter is in the holder",
        whose, begin, under, cutter->flank_length));
  const double over = end - tool.actual_length;
  if (std::abs(over) > least)
    texts.push_back(fmt::format(
        "the holder{} ends {:.6g} mm above the tip, {:.6g} mm {} the nose of the spindle "
        "(length_mm "
        "{:.6g}){}",
        whose, end, std::abs(over), over > 0.0 ? "beyond" : "short of", tool.actual_length,
        over > 0.0 ? "" : ": what is between them is met by nothing"));
}

/// Arcs that bulge inwards are cut as chords.
void add_chord_text(const ToolDescription& tool, std::vector<std::string>& texts) {
  const double sag = std::max(chord_sag(tool.nominal_form), chord_sag(tool.actual_form));
  if (sag > 0.0)
    texts.push_back(fmt::format(
        "the arcs of the tool{} that bulge inwards are cut as chords: it is larger there by up to "
        "{:.3g} um",
        tool.number ? fmt::format(" {}", *tool.number) : "", sag / units::um));
}

double shank_radius(const Scene& scene, const cutting::Cutter& cutter) {
  return scene.tool.shank_radius.value_or(cutting::shank_radius(cutter));
}

}  // namespace

std::optional<double> narrowest_half_width(const PartDescription& part) {
  std::optional<double> half;
  const auto add = [&](const Tolerance& tolerance) {
    const double own = 0.5 * (tolerance.upper - tolerance.lower);
    half = std::min(half.value_or(own), own);
  };
  if (part.tolerance) add(*part.tolerance);
  for (const PartRegion& region : part.regions)
    if (region.tolerance) add(*region.tolerance);
  return half;
}

JudgedPlaces judged_places(const cutting::Design& design) {
  JudgedPlaces places;
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i) places.vertices += is_judged(design, i);
  for (Eigen::Index t = 0; t < design.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = design.triangles(t, k), b = design.triangles(t, (k + 1) % 3);
      if (is_judged(design, a) && is_judged(design, b))
        places.apart =
            std::max(places.apart, (design.vertices.row(a) - design.vertices.row(b)).norm());
    }
  return places;
}

bool is_sparse(const JudgedPlaces& places, const ToolDescription& tool) {
  const auto* cutter = std::get_if<cutting::Cutter>(&tool.nominal);
  return places.vertices < least_judged ||
         (cutter != nullptr && places.apart > 2.0 * cutter->radius);
}

std::vector<std::string> program_warnings(const Scene& scene, const cutting::Design& design_w,
                                          const program::Path& path,
                                          const program::Unreached& unreached) {
  std::vector<std::string> warnings = tool_comment_warnings(path, tools_of(scene));
  for (std::string text : {unreached_text(unreached), no_feed_text(path), unit_change_text(path),
                           coarse_text(scene, design_w), sparse_text(scene, design_w)})
    if (!text.empty()) warnings.push_back(std::move(text));
  for (const ToolDescription& tool : tools_of(scene)) {
    add_holder_texts(tool, warnings);
    add_chord_text(tool, warnings);
  }
  return warnings;
}

ShankContacts shank_contacts(const Scene& scene, const cutting::Design& design_w,
                             const NominalRun& run) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  if (cutter == nullptr) return {};
  const cutting::CutterMotion motion = cutter_motion(run.T_wt, run.samples);
  ShankContacts found;
  found.shank = cutting::shank_contact(
      design_w, *cutter, motion,
      {.length = scene.tool.length, .band = scene.band, .radius = shank_radius(scene, *cutter)});
  if (scene.tool.holder)
    found.holder = cutting::idle_contact(design_w, cutting::idle_pieces(*scene.tool.holder), motion,
                                         scene.band);
  return found;
}

ShankContacts joined(const ShankContacts& a, const ShankContacts& b) {
  const auto both = [](const std::optional<cutting::ShankContact>& first,
                       const std::optional<cutting::ShankContact>& second) {
    if (!first || !second) return first ? first : second;
    cutting::ShankContact contact = second->deepest > first->deepest ? *second : *first;
    contact.vertices = std::max(first->vertices, second->vertices);
    contact.first_line = first->first_line;
    return std::optional(contact);
  };
  return {both(a.shank, b.shank), both(a.holder, b.holder), true};
}

std::vector<std::string> shank_warnings(const Scene& scene, const ShankContacts& contacts) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  std::vector<std::string> warnings;
  const auto add = [&](const std::string& what,
                       const std::optional<cutting::ShankContact>& contact) {
    if (!contact) return;
    warnings.push_back(fmt::format(
        "{} goes more than {:.4g} mm into the design at {} vertices{}, {} {:.3f} mm deep (line {}, "
        "first line {})",
        what, contact->passed, contact->vertices, contacts.in_windows ? " or more" : "",
        contact->deeper ? "at least" : "up to", contact->deepest, contact->line,
        contact->first_line));
  };
  if (cutter == nullptr) return warnings;
  const double radius = shank_radius(scene, *cutter);
  add(fmt::format("the shank above the flank ({:.4g} mm above the tip{})", cutter->flank_length,
                  radius == cutter->radius ? "" : fmt::format(", radius {:.4g} mm", radius)),
      contacts.shank);
  add("the holder", contacts.holder);
  return warnings;
}

}  // namespace abbe::sim
