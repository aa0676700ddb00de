#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "errors/compliance.h"
#include "kinematics/units.h"

namespace abbe::errors {
namespace {

constexpr double arm = 100.0;  // mm, at which a turn counts as much as a shift

void require(bool good, const std::string& what, const std::string& expected, double seen) {
  if (!good)
    throw std::invalid_argument(fmt::format("{}: expected {}, seen {}", what, expected, seen));
}

// Conditions are written so that NaN fails them.
bool is_positive(double x) { return x > 0.0 && std::isfinite(x); }

void check(const CantileverSection& section, const std::string& who) {
  require(is_positive(section.length), who, "a length above 0 mm", section.length);
  require(is_positive(section.diameter), who, "a diameter above 0 mm", section.diameter);
  require(is_positive(section.youngs_modulus), who, "a Young's modulus above 0 N/mm^2",
          section.youngs_modulus);
  require(section.poisson_ratio > -1.0 && section.poisson_ratio <= 0.5, who,
          "a Poisson ratio above -1 and at most 0.5", section.poisson_ratio);
}

}  // namespace

void validate(const Compliance& C, const std::string& what) {
  Eigen::Matrix<double, 6, 1> scale;
  scale << 1.0, 1.0, 1.0, arm, arm, arm;
  const Compliance scaled = scale.asDiagonal() * C * scale.asDiagonal();
  if (!scaled.allFinite())
    throw std::invalid_argument(what + ": expected finite compliances, seen one that is not");
  const double largest = scaled.cwiseAbs().maxCoeff();
  const double slack = 1e-9 * largest;
  const double skew = (scaled - scaled.transpose()).cwiseAbs().maxCoeff();
  require(skew <= slack, what, "a symmetric compliance (off by 1e-9 of its largest entry at most)",
          skew / largest);
  // divided first: squares of huge entries would overflow
  const Compliance one = largest > 0.0 ? Compliance(scaled / largest) : scaled;
  const Eigen::SelfAdjointEigenSolver<Compliance> solver(one, Eigen::EigenvaluesOnly);
  require(solver.eigenvalues()[0] >= -1e-9, what,
          "a compliance without negative eigenvalue (pushed, it must not come closer)",
          solver.eigenvalues()[0] * largest);
}

Compliance stepped_cantilever(std::span<const CantileverSection> sections) {
  if (sections.empty())
    throw std::invalid_argument("cantilever: expected at least one section, seen none");
  Compliance C = Compliance::Zero();
  double from = 0.0;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const CantileverSection& section = sections[i];
    check(section, fmt::format("cantilever section {}", i + 1));
    const double to = from + section.length;
    const double E = section.youngs_modulus;
    const double d2 = section.diameter * section.diameter;
    const double EI = E * pi * d2 * d2 / 64.0;
    const double GJ = EI / (1.0 + section.poisson_ratio);  // G = E / 2(1 + nu), J = 2 I
    // integrals of 1, z and z^2 over the section
    const double i0 = section.length / EI;
    const double i1 = 0.5 * (to + from) * i0;
    const double i2 = (to * to + to * from + from * from) / 3.0 * i0;
    C(0, 0) += i2;
    C(1, 1) += i2;
    C(2, 2) += section.length / (E * pi * d2 / 4.0);
    C(3, 3) += i0;
    C(4, 4) += i0;
    C(5, 5) += section.length / GJ;
    C(3, 1) += i1;  // pushed along y, the free end turns about +x, since the clamp lies along +z
    C(4, 0) -= i1;
    from = to;
  }
  C(1, 3) = C(3, 1);
  C(0, 4) = C(4, 0);
  validate(C, "cantilever");
  return C;
}

}  // namespace abbe::errors
