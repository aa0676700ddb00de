#include "sim/report/form_texture.h"

#include <cmath>
#include <vector>

#include <tbb/parallel_for.h>

#include "cutting/areal_filter.h"

namespace abbe::sim {
namespace {

/// Of what the filter leaves out, vertices and places within triangles by their weights.
std::optional<errors::metrology::Areal> texture_of(const cutting::Design& design,
                                                   const cutting::Surface& surface,
                                                   const Eigen::VectorXd& filtered) {
  const cutting::Weights weights = cutting::weights(surface, design);
  std::vector<double> texture, area;
  for (Eigen::Index i = 0; i < filtered.size(); ++i) {
    if (!std::isfinite(filtered[i])) continue;
    texture.push_back(surface.residual[i] - filtered[i]);
    area.push_back(weights.vertex[i]);
  }
  Eigen::VectorXd within = surface.within;
  tbb::parallel_for(Eigen::Index(0), within.size(), [&](Eigen::Index t) {
    within[t] -= cutting::at_place_within(surface.looked_within, filtered, design.triangles, t);
  });
  for (Eigen::Index t = 0; t < weights.within.size(); ++t) {
    if (!(weights.within[t] > 0.0)) continue;
    texture.push_back(within[t]);
    area.push_back(weights.within[t]);
  }
  const auto n = Eigen::Index(texture.size());
  const Eigen::Map<const Eigen::VectorXd> heights(texture.data(), n), parts(area.data(), n);
  if (!(parts.sum() > 0.0)) return std::nullopt;
  return errors::metrology::areal(Eigen::MatrixX2d::Zero(n, 2), heights, parts,
                                  {.reference = errors::metrology::ArealReference::Mean});
}

}  // namespace

FormAndTexture form_and_texture(const Job& job, const cutting::Surface& surface,
                                const cutting::ToleranceBands& tolerance) {
  FormAndTexture parted;
  parted.filtered = cutting::gaussian_form(job.design_w, surface, job.scene.part.form_cutoff);
  cutting::Surface form = surface;
  form.residual = parted.filtered;
  form.looked_within = cutting::Surface::Within::None;
  form.within.resize(0);  // smooth: its vertices stand for what is around them
  parted.form = cutting::statistics(form, job.design_w, tolerance);
  // places at random of which too few carry the form are no texture of it: each stands beside the
  // form of others
  if (surface.looked_within != cutting::Surface::Within::Random ||
      cutting::resolves_form(job.design_w, job.scene.part.form_cutoff))
    parted.texture = texture_of(job.design_w, surface, parted.filtered);
  return parted;
}

}  // namespace abbe::sim
