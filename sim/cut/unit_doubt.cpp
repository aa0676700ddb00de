#include "sim/cut/unit_doubt.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/cut/named_mesh.h"

namespace abbe::sim {
namespace {

constexpr double hardly = 0.5;        // of the judged area, below which a unit is doubted
constexpr double a_fit = 0.1;         // of the judged area, which the part has to be cut over
constexpr double so_much_more = 4.0;  // times what is cut as it stands

// from one unit of length to another
constexpr std::array factors{units::inch, 10.0, 100.0, 1000.0, 1.0 / units::inch, 0.1, 0.01, 0.001};

const MeshFile* mesh_of(const Scene& scene) { return std::get_if<MeshFile>(&scene.part.shape); }

/// The design made larger about the zero of its own frame.
cutting::Design scaled(cutting::Design design_w, const kinematics::Pose& T_wm, double factor) {
  const Eigen::RowVector3d zero = T_wm.translation().transpose();
  design_w.vertices = (factor * (design_w.vertices.rowwise() - zero)).rowwise() + zero;
  design_w.area *= factor * factor;
  return design_w;
}

double largest_size(const Spans& spans) {
  double largest = 0.0;
  for (const Span& span : spans)
    if (std::isfinite(span.size())) largest = std::max(largest, span.size());
  return largest;
}

/// Who may be wrong about a unit if the part fits so many times as large.
std::string advice(const Job& job, double factor) {
  std::vector<std::string> all;
  if (const MeshFile* mesh = mesh_of(job.scene))
    if (const std::string word = unit_word(mesh->unit * factor); !word.empty())
      all.push_back(fmt::format("part.unit = \"{}\" may be meant", word));
  const auto inch = std::ranges::find_if(job.path.unit_words, &program::UnitWord::inch);
  if (factor == units::inch && inch != job.path.unit_words.end())
    all.push_back(fmt::format("G20 on line {} may not belong there", inch->line));
  if (factor == 1.0 / units::inch && inch == job.path.unit_words.end())
    all.push_back("the program may be in inches and lack its G20");
  if (all.empty()) all.push_back("part or program may be in another unit");
  std::string text = fmt::format("{}", fmt::join(all, ", or "));
  return mesh_of(job.scene) ? text + "; part.any_size = true if its size is meant" : text;
}

}  // namespace

std::string unit_doubt(const Job& job, const WithinReach& reach) {
  const MeshFile* mesh = mesh_of(job.scene);
  if (!std::holds_alternative<ProgramDescription::File>(job.scene.program.source)) return {};
  if ((mesh && mesh->any_size) || reach.share >= hardly) return {};
  const auto& vertices = job.design_w.vertices;  // judged or not
  const double part = (vertices.colwise().maxCoeff() - vertices.colwise().minCoeff()).maxCoeff();
  const double path = largest_size(swept_spans(job).tip);
  const cutting::Design few_w = thinned(job.design_w);
  double best_factor = 1.0;
  WithinReach best;
  for (const double factor : factors) {
    if (!(path > 0.5 * factor * part && path < 2.0 * factor * part)) continue;  // another size
    const WithinReach with = within_reach(scaled(few_w, job.scene.part.T_wm, factor), job);
    if (!(with.cut > best.cut)) continue;
    best = with;
    best_factor = factor;
  }
  if (best.cut < a_fit || best.cut < so_much_more * reach.cut) return {};
  return fmt::format(
      "{:.2g} % of the judged area is cut within {} mm of the design; with the part {:.4g} times "
      "as "
      "large it would be {:.3g} %: {}",
      100.0 * reach.cut, job.scene.band, best_factor, 100.0 * best.cut, advice(job, best_factor));
}

}  // namespace abbe::sim
