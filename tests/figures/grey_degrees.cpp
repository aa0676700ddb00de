// Liu's degrees of a widely copied worked example.

#include "errors/identification/sensor_choice.h"
#include "tests/figures/figure.h"
#include "tests/test.h"

namespace abbe::figures {

std::vector<Figure> grey_degrees() {
  namespace identification = errors::identification;
  const auto degree = [](identification::GreyKind kind) {
    return [kind] {
      VectorXd first(5), second(5);
      first << 30.5, 34.7, 35.9, 38.2, 41;
      second << 22.1, 25.4, 27.1, 28.3, 31.5;
      identification::GreyOptions options;
      options.kind = kind;
      return fmt::format("{:.6f}", identification::grey_degrees(first, second, options).degree[0]);
    };
  };
  const std::string paper = "copied worked example", command = "`abbe test -R '^Figures'`";
  const std::string why = "the example takes first differences where the definition takes areas";
  using identification::GreyKind;
  return {{paper, "absolute degree (Liu)", "0.9323", degree(GreyKind::Absolute), command, why},
          {paper, "relative degree", "0.9914", degree(GreyKind::Relative), command, why},
          {paper, "comprehensive degree, θ = 0.5", "0.9618", degree(GreyKind::Comprehensive),
           command, why}};
}

}  // namespace abbe::figures
