#pragma once

#include <limits>
#include <numbers>

/// Internal units are mm, rad, s, N, K. These literals are for input and output: `4.0_um`,
/// `90.0_deg`.
namespace abbe {

inline constexpr double pi = std::numbers::pi;

namespace units {
inline constexpr double um = 1e-3;                ///< mm
inline constexpr double nm = 1e-6;                ///< mm
inline constexpr double inch = 25.4;              ///< mm
inline constexpr double urad = 1e-6;              ///< rad
inline constexpr double deg = pi / 180.0;         ///< rad
inline constexpr double full_turn = 2.0 * pi;     ///< rad
inline constexpr double rpm = pi / 30.0;          ///< rad/s
inline constexpr double mm_per_min = 1.0 / 60.0;  ///< mm/s
}  // namespace units

namespace literals {
constexpr double operator""_um(long double value) { return double(value) * units::um; }
constexpr double operator""_nm(long double value) { return double(value) * units::nm; }
constexpr double operator""_urad(long double value) { return double(value) * units::urad; }
constexpr double operator""_deg(long double value) { return double(value) * units::deg; }
}  // namespace literals

inline constexpr double infinity = std::numeric_limits<double>::infinity();
/// Value of a quantity that does not exist (NaN).
inline constexpr double none = std::numeric_limits<double>::quiet_NaN();

}  // namespace abbe
