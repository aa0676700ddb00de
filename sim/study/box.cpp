#include "sim/study/box.h"

#include <cmath>

#include "sim/study/distribution.h"

namespace abbe::sim::study {

using Eigen::Index;
using Eigen::VectorXd;

Box box_of(const Study& study, double coverage) {
  const Index p = Index(study.inputs.size());
  Box box{VectorXd(p), VectorXd(p)};
  for (Index i = 0; i < p; ++i) {
    const Distribution& d = study.inputs[std::size_t(i)].distribution;
    const bool open_below = d.kind == Distribution::Kind::LogNormal && d.low <= 0.0;
    const double low = quantile(d, 0.0), high = quantile(d, 1.0);
    box.low[i] = std::isfinite(low) && !open_below ? low : at_score(d, -coverage);
    box.high[i] = std::isfinite(high) ? high : at_score(d, coverage);
  }
  return box;
}

}  // namespace abbe::sim::study
