#include "errors/metrology/circle_result.h"

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;

Figure estimated(std::string name, const char* unit, const std::optional<Estimated>& one,
                 double size) {
  Figure figure{std::move(name), unit, {}};
  if (one) figure.value = Estimated{one->value / size, one->u / size};
  return figure;
}

/// A cause of `cause_names` with the letters of a plane for its u and v.
std::string with_axes(const std::string& cause, const std::string& plane) {
  if (cause == "scale") return fmt::format("scale_{}_minus_{}", plane[0], plane[1]);
  if (!cause.ends_with("_u") && !cause.ends_with("_v")) return cause;
  return cause.substr(0, cause.size() - 1) + plane[cause.back() == 'u' ? 0 : 1];
}

/// Causes of a circle; all are open where it has too few places.
CircularCauses causes_of(const CircleTest& test, bool enough) {
  if (enough) return circular_causes(test.runs);
  CircularCauses causes;
  causes.undetermined.assign(cause_names.begin(), cause_names.end());
  return causes;
}

/// Which causes a circle leaves open, and why.
std::string why_undetermined(const std::vector<std::string>& open, int places, bool both_senses) {
  const std::string names = fmt::format("{}", fmt::join(open, ", "));
  constexpr int least = circular_cause_count + 1;
  if (places < least)
    return fmt::format(
        "{} cannot be determined: {} causes take readings at {} different places or more, each "
        "sense counted apart, seen {}",
        names, circular_cause_count, least, places);
  return fmt::format("{} cannot be determined: they read alike at the {} places that were read{}",
                     names, places, both_senses ? "" : ", in one sense alone");
}

FigureGroup cause_figures(const CircleTest& test) {
  const int places = place_count(test.runs);
  const bool enough = places > circular_cause_count;
  const CircularCauses causes = causes_of(test, enough);
  const auto name = [&](const char* cause) { return with_axes(cause, test.plane); };
  std::vector<std::string> open;
  for (const std::string& cause : causes.undetermined) open.push_back(with_axes(cause, test.plane));
  FigureGroup group{"causes"};
  group.figures = {estimated("squareness", "urad", causes.squareness, units::urad),
                   {"squareness_sign", "",
                    fmt::format("{1} turned about {0} x {1}", test.plane[0], test.plane[1])},
                   estimated(name("scale"), "um_per_m", causes.scale, 1e-6),
                   estimated(name("reversal_u"), "um", causes.reversal_u, units::um),
                   estimated(name("reversal_v"), "um", causes.reversal_v, units::um),
                   estimated(name("centre_u"), "um", causes.centre_u, units::um),
                   estimated(name("centre_v"), "um", causes.centre_v, units::um),
                   figure("unexplained", enough ? std::optional(causes.residual) : std::nullopt),
                   {"undetermined", "", open}};
  const bool both_senses =
      test.runs.anticlockwise.angle.size() > 0 && test.runs.clockwise.angle.size() > 0;
  if (!open.empty())
    group.figures.push_back(
        {"undetermined_because", "", why_undetermined(open, places, both_senses)});
  return group;
}

}  // namespace

TestResult circle_result(const CircleTest& test) {
  const Circular c = circular(test.runs);
  const auto if_known = [&](double value) {
    return test.zero_known ? std::optional(value) : std::nullopt;
  };
  Figure radius{"radius", "mm", {}};
  if (test.zero_known) radius.value = c.circle.radius;
  TestResult result{test.name, "ISO 230-4:2005 circular test", {}, {cause_figures(test)}};
  std::vector<Figure>& f = result.figures;
  f = {{"plane", "", test.plane},
       {"readings", "", test.runs.anticlockwise.radius.size() + test.runs.clockwise.radius.size()},
       {"places", "", Index(place_count(test.runs))},
       {"nominal_radius", "mm", test.runs.nominal_radius},
       radius,
       figure(std::string("centre_") + test.plane[0], c.circle.centre.x()),
       figure(std::string("centre_") + test.plane[1], c.circle.centre.y())};
  const auto put = [&](const std::string& way, const std::optional<CircularFigures>& one) {
    if (!one) return;
    f.push_back(figure("G_" + way + "_lsq", one->G_lsq));
    f.push_back(figure("G_" + way + "_minimum_zone", one->G_minimum_zone));
    f.push_back(figure("F_max_" + way, if_known(one->F_max)));
    f.push_back(figure("F_min_" + way, if_known(one->F_min)));
  };
  put("anticlockwise", c.anticlockwise);
  put("clockwise", c.clockwise);
  put("both", c.both);
  f.push_back({"F_from", "",
               c.centre_is == CircleCentre::LeastSquares
                   ? "least-squares centre"
                   : "centre as set up, since this is no full circle"});
  f.push_back(figure("D", if_known(c.D)));
  f.push_back(figure("H", c.H));
  return result;
}

}  // namespace abbe::errors::metrology
