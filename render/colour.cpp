#include "render/colour.h"

#include <array>

#include <vtkColorTransferFunction.h>
#include <vtkNew.h>

namespace abbe::render {

std::vector<Colour> diverging(int n) {
  vtkNew<vtkColorTransferFunction> scale;
  scale->SetColorSpaceToDiverging();
  scale->AddRGBPoint(-1.0, 0.230, 0.299, 0.754);
  scale->AddRGBPoint(1.0, 0.706, 0.016, 0.150);
  std::vector<Colour> table(n);
  for (int i = 0; i < n; ++i) {
    std::array<double, 3> rgb{};
    scale->GetColor(n > 1 ? -1.0 + 2.0 * i / (n - 1) : 0.0, rgb.data());
    table[i] = {rgb[0], rgb[1], rgb[2]};
  }
  return table;
}

Colour series_colour(int index) {
  static constexpr std::array<Colour, series_colours> wheel{{{0.00, 0.27, 0.55},
                                                             {0.80, 0.30, 0.05},
                                                             {0.10, 0.52, 0.35},
                                                             {0.55, 0.25, 0.60},
                                                             {0.75, 0.55, 0.05},
                                                             {0.35, 0.36, 0.38}}};
  return wheel[index % wheel.size()];
}

}  // namespace abbe::render
