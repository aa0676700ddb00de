#pragma once

#include <string>
#include <string_view>

/// Units that stand at the end of a key: "radius_mm".
namespace abbe::sim {

/// Factor from the unit that ends a key to mm, rad, s, N, K, and to kg, W and A where the key has
/// them: "_um" gives 1e-3, "_rpm" pi/30, "_um_per_m_K" 1e-6; 1 without.
double unit_of(std::string_view key);

/// Key without its unit: "radius_mm" gives "radius".
std::string_view stem_of(std::string_view key);

/// Unit of a key as messages name it: "mm", "no unit".
std::string unit_name(std::string_view key);

}  // namespace abbe::sim
