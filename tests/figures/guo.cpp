// Guo et al. 2016: the elements of the gantry.

#include "tests/figures/figure.h"
#include "tests/test.h"

namespace abbe::figures {
namespace {

/// Elements of the typical gantry by their kinds.
struct Count {
  int motions = 0, spindle = 0, squareness = 0, parallelism = 0, centres = 0;
};

Count elements_of_the_gantry() {
  Count count;
  std::set<std::string> seen;
  for (const errors::Element& element : scene_of("gantry_dome").geometric.elements) {
    const errors::ElementName& name = element.name;
    if (!seen.insert(errors::to_string(name)).second) continue;
    const bool slide = name.axis >= 'X' && name.axis <= 'Z';
    int& kind = !name.location    ? (name.axis == 'S' ? count.spindle : count.motions)
                : slide           ? count.squareness
                : name.is_angle() ? count.parallelism
                                  : count.centres;
    ++kind;
  }
  return count;
}

}  // namespace

std::vector<Figure> guo() {
  const auto counted = [] {
    const Count n = elements_of_the_gantry();
    return fmt::format("{} + {} + {} + {} = {}, and {} offsets of rotary centres", n.motions,
                       n.spindle, n.squareness, n.parallelism,
                       n.motions + n.spindle + n.squareness + n.parallelism, n.centres);
  };
  return {{"Guo et al. 2016", "elements of the CXYZA gantry for each of three sources",
           "30 + 5 + 3 + 4 = 42", counted, "`abbe check scenes/gantry_dome.toml`",
           "where the rotary axes stand is an error as well; the paper leaves it out"}};
}

}  // namespace abbe::figures
