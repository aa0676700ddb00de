#include "errors/metrology/surface_texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "kinematics/bad_input.h"
#include "kinematics/decompositions.h"

namespace abbe::errors::metrology {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Returns the weights of the filter at 0, 1, 2 ... steps from the point.
/// @param most  maximum number of weights
VectorXd profile_weights(double step, double nesting_index, Index most) {
  const double variance = nesting_index * nesting_index * std::numbers::ln2 /
                          (2.0 * std::numbers::pi * std::numbers::pi);
  // Weights beyond one nesting index are below 1e-7 and dropped.
  const double reach = std::min(nesting_index / step * (1.0 + 1e-12), double(most - 1));
  VectorXd weight(Index(reach) + 1);
  for (Index k = 0; k < weight.size(); ++k)
    weight[k] = std::exp(-0.5 * double(k) * double(k) * step * step / variance);
  return weight;
}

/// Lines fitted to the heights with the weights of the filter, used where part of its window is
/// beyond the profile. Moments are prefix sums, so a window costs no more than its heights.
class WindowFit {
 public:
  WindowFit(const VectorXd& z, const VectorXd& weight) : z_(z), reach_(weight.size() - 1) {
    weight_.resize(2 * reach_ + 1);
    weight_ << weight.tail(reach_).reverse(), weight;
    const VectorXd d = VectorXd::LinSpaced(2 * reach_ + 1, -double(reach_), double(reach_));
    first_ = weight_.cwiseProduct(d);
    const VectorXd second = first_.cwiseProduct(d);
    sums_.setZero(2 * reach_ + 2, 3);
    for (Index j = 0; j < weight_.size(); ++j)
      sums_.row(j + 1) = sums_.row(j) + Eigen::RowVector3d(weight_[j], first_[j], second[j]);
  }

  /// Returns the value of the line about point i, at i.
  double at(Index i) const {
    const Index from = std::max(Index(0), i - reach_), to = std::min(z_.size(), i + reach_ + 1);
    const Index window = from - i + reach_, count = to - from;
    const Eigen::RowVector3d m = sums_.row(window + count) - sums_.row(window);
    const double z0 = weight_.segment(window, count).dot(z_.segment(from, count));
    const double z1 = first_.segment(window, count).dot(z_.segment(from, count));
    const double determinant = m[0] * m[2] - m[1] * m[1];
    // A single point has no slope.
    return determinant > 0.0 ? (m[2] * z0 - m[1] * z1) / determinant : z0 / m[0];
  }

 private:
  const VectorXd& z_;
  Index reach_;
  VectorXd weight_, first_;  // at -reach .. reach: weight times 1 and times the distance in steps
  Eigen::MatrixX3d sums_;    // cumulative sums of weights times 1, distance, its square
};

struct Places {
  Index first, last;  // last is exclusive
};

/// Returns section k of an evaluation; all of it for k = -1.
Places places_of(const Profile& profile, const EvaluationLength& e, int k) {
  const double from = e.from + std::max(k, 0) * e.section;
  const double to = k < 0 ? e.from + e.sections * e.section : from + e.section;
  // A point exactly on a boundary belongs to the section that begins there.
  const auto number = [&](double at) { return Index(std::ceil(at / profile.step - 1e-6)); };
  const Places places{std::max(Index(0), number(from)), std::min(profile.z.size(), number(to))};
  require(places.last > places.first, "profile: expected at least a place in every section");
  return places;
}

/// Crossings of the mean line between two significant parts of a profile.
struct Crossings {
  std::vector<double> first, last;  // the first and the last of several between two parts, in steps
};

Crossings crossings_of(const VectorXd& z, double above, double below) {
  Crossings found;
  Index at = -1;  // last point of the previous significant part
  for (Index i = 0; i < z.size(); ++i) {
    if (!(z[i] > above) && !(z[i] < -below)) continue;
    if (at >= 0 && (z[i] > 0.0) != (z[at] > 0.0)) {
      const auto crossing = [&](Index k) { return double(k) + z[k] / (z[k] - z[k + 1]); };
      const auto crosses = [&](Index k) { return (z[k] > 0.0) != (z[k + 1] > 0.0); };
      Index first = at, last = i - 1;
      while (!crosses(first)) ++first;
      while (!crosses(last)) --last;
      found.first.push_back(crossing(first));
      found.last.push_back(crossing(last));
    }
    at = i;
  }
  return found;
}

/// Returns the mean length of the profile elements, in steps.
std::optional<double> element_spacing(const VectorXd& z, double above, double below) {
  const Crossings crossings = crossings_of(z, above, below);
  const std::size_t n = crossings.first.size();
  // Two elements share a crossing: an element needs three.
  if (n < 3) return std::nullopt;
  const std::size_t elements = (n - 1) / 2;
  const double from_left = crossings.first[2 * elements] - crossings.first[0];
  const double from_right = crossings.last[n - 1] - crossings.last[n - 1 - 2 * elements];
  return 0.5 * (from_left + from_right) / double(elements);
}

double gradient(const Profile& profile, const Places& places) {
  const VectorXd& z = profile.z;
  // The sixth-order difference needs three points on either side.
  const Index first = std::max(places.first, Index(3));
  const Index last = std::min(places.last, z.size() - 3);
  double squares = 0.0;
  for (Index i = first; i < last; ++i) {
    const double slope =
        (z[i + 3] - z[i - 3] - 9.0 * (z[i + 2] - z[i - 2]) + 45.0 * (z[i + 1] - z[i - 1])) /
        (60.0 * profile.step);
    squares += slope * slope;
  }
  return last > first ? std::sqrt(squares / double(last - first)) : 0.0;
}

constexpr double um = 1e-3;

constexpr std::array classes = {SettingClass{"Sc1", 0.08, 0.08, 0.4, 2.5 * um, 0.5 * um},
                                SettingClass{"Sc2", 0.25, 0.25, 1.25, 2.5 * um, 0.5 * um},
                                SettingClass{"Sc3", 0.8, 0.8, 4.0, 2.5 * um, 0.5 * um},
                                SettingClass{"Sc4", 2.5, 2.5, 12.5, 8.0 * um, 1.5 * um},
                                SettingClass{"Sc5", 8.0, 8.0, 40.0, 25.0 * um, 5.0 * um}};

/// Returns heights every `step`, linear between those given.
VectorXd resampled(const VectorXd& s, const VectorXd& z, double step, Index n) {
  VectorXd heights(n);
  Index k = 0;
  for (Index i = 0; i < n; ++i) {
    const double at = std::min(s[0] + double(i) * step, s[s.size() - 1]);
    while (k + 2 < s.size() && s[k + 1] < at) ++k;
    const double width = s[k + 1] - s[k];
    const double u = width > 0.0 ? std::clamp((at - s[k]) / width, 0.0, 1.0) : 1.0;
    heights[i] = std::lerp(z[k], z[k + 1], u);
  }
  return heights;
}

void check_line(const VectorXd& s, const VectorXd& z, const TextureOptions& options) {
  require(s.size() == z.size() && s.size() >= 2, "profile_texture: expected two places or more");
  require(s.allFinite() && z.allFinite(), "profile_texture: expected finite numbers");
  for (Index i = 0; i + 1 < s.size(); ++i)
    require(s[i + 1] >= s[i], "profile_texture: expected places that rise");
  require(s[s.size() - 1] > s[0], "profile_texture: expected a line of some length");
  require(std::isfinite(options.Nic) && options.Nic > 0.0, "profile_texture: Nic must be positive");
  require(!options.Nis || (std::isfinite(*options.Nis) && *options.Nis > 0.0),
          "profile_texture: Nis must be positive");
  require(options.sections >= 1 && options.places >= 16,
          "profile_texture: expected sections, and at least 16 places");
}

EvaluationLength central_sections(double length, double section, int wanted) {
  const int fit = int(std::min(1e6, std::floor(length / section * (1.0 + 1e-9))));
  if (fit < 1) return {0.0, length, 1};
  const int sections = std::min(wanted, fit);
  return {0.5 * (length - sections * section), section, sections};
}

}  // namespace

VectorXd mean_line(const Profile& profile, double nesting_index) {
  const VectorXd& z = profile.z;
  require(std::isfinite(profile.step) && profile.step > 0.0, "mean_line: step must be positive");
  require(std::isfinite(nesting_index) && nesting_index > 0.0,
          "mean_line: the nesting index must be positive");
  require(z.allFinite(), "mean_line: expected finite heights");
  require(z.size() > 0, "mean_line: expected heights");
  const VectorXd weight = profile_weights(profile.step, nesting_index, z.size());
  const Index k = weight.size() - 1, inner = z.size() - 2 * k;
  VectorXd line(z.size());
  if (inner > 0) {
    VectorXd sum = weight[0] * z.segment(k, inner);
    for (Index j = 1; j <= k; ++j)
      sum += weight[j] * (z.segment(k - j, inner) + z.segment(k + j, inner));
    double all = weight[0];
    for (Index j = 1; j <= k; ++j) all += 2.0 * weight[j];
    line.segment(k, inner) = sum / all;
  }
  const Index end = inner > 0 ? k : z.size();
  const WindowFit fit(z, weight);
  for (Index i = 0; i < end; ++i) {
    line[i] = fit.at(i);
    if (inner > 0) line[z.size() - 1 - i] = fit.at(z.size() - 1 - i);
  }
  return line;
}

VectorXd straight_line(const Profile& profile) {
  const Index n = profile.z.size();
  if (n < 2) return profile.z;
  const double middle = 0.5 * double(n - 1);
  double mean = 0.0, moment = 0.0, squares = 0.0;
  for (Index i = 0; i < n; ++i) mean += profile.z[i] / double(n);
  for (Index i = 0; i < n; ++i) {
    const double d = double(i) - middle;
    moment += d * (profile.z[i] - mean);
    squares += d * d;
  }
  VectorXd line(n);
  for (Index i = 0; i < n; ++i) line[i] = mean + moment / squares * (double(i) - middle);
  return line;
}

std::span<const SettingClass> setting_classes() { return classes; }

const SettingClass& setting_class(double Nic) {
  const auto ratio = [&](const SettingClass& one) { return std::abs(std::log(one.Nic / Nic)); };
  return *std::min_element(
      classes.begin(), classes.end(),
      [&](const SettingClass& a, const SettingClass& b) { return ratio(a) < ratio(b); });
}

ProfileParameters parameters(const Profile& profile, const EvaluationLength& evaluation) {
  require(evaluation.sections >= 1 && evaluation.section > 0.0 && evaluation.from >= 0.0,
          "profile: expected a section or more within the profile");
  const Places all = places_of(profile, evaluation, -1);
  const VectorXd z = profile.z.segment(all.first, all.last - all.first);
  const auto n = double(z.size());
  ProfileParameters result;
  double squares = 0.0, cubes = 0.0, fourths = 0.0;
  for (const double height : z) {
    result.a += std::abs(height) / n;
    squares += height * height / n;
  }
  result.q = std::sqrt(squares);
  if (result.q > 0.0) {
    for (const double height : z) {
      const double unit = height / result.q;
      cubes += unit * unit * unit / n;
      fourths += unit * unit * unit * unit / n;
    }
    result.sk = cubes;
    result.ku = fourths;
  }
  result.t = z.maxCoeff() - z.minCoeff();
  for (int k = 0; k < evaluation.sections; ++k) {
    const Places places = places_of(profile, evaluation, k);
    const auto section = profile.z.segment(places.first, places.last - places.first);
    const double highest = section.maxCoeff(), lowest = section.minCoeff();
    result.p += highest / evaluation.sections;
    result.v -= lowest / evaluation.sections;
    result.zx = std::max(result.zx, highest - lowest);
  }
  result.z = result.p + result.v;
  constexpr double significant = 0.1;  // fraction of mean peak height and pit depth, the default
                                       // discrimination of ISO 21920-2
  if (const auto spacing = element_spacing(z, significant * std::max(result.p, 0.0),
                                           significant * std::max(result.v, 0.0)))
    result.sm = *spacing * profile.step;
  result.dq = gradient(profile, all);
  return result;
}

ProfileTexture profile_texture(const VectorXd& s, const VectorXd& z,
                               const TextureOptions& options) {
  check_line(s, z, options);
  constexpr double places_an_index = 5.0;
  ProfileTexture result;
  result.length = s[s.size() - 1] - s[0];
  result.requested_Nis = options.Nis.value_or(setting_class(options.Nic).Nis);
  const double steps = std::min(std::ceil(result.length * places_an_index / result.requested_Nis),
                                double(options.places - 1));
  // At least 16 points: the gradient needs seven, and sections must not be empty.
  const Index n = Index(std::max(steps, 15.0)) + 1;
  result.primary.step = result.length / double(n - 1);
  // 1e-9: rounding must not raise the index.
  result.Nis = std::max(result.requested_Nis, places_an_index * result.primary.step * (1.0 - 1e-9));
  const Profile traced{result.primary.step, resampled(s, z, result.primary.step, n)};
  result.primary.z = mean_line(traced, result.Nis);
  result.line = straight_line(result.primary);
  result.primary.z -= result.line;
  result.waviness = mean_line(result.primary, options.Nic);
  result.roughness = result.primary.z - result.waviness;
  result.whole = {0.0, result.length + result.primary.step, 1};
  result.sections = central_sections(result.length, options.Nic, options.sections);
  result.run_in = result.sections.from;
  result.P = parameters(result.primary, result.whole);
  result.W = parameters({result.primary.step, result.waviness}, result.whole);
  result.R = parameters({result.primary.step, result.roughness}, result.sections);
  return result;
}

namespace {

void check(const Eigen::MatrixX2d& xy, const VectorXd& z, const VectorXd& weights) {
  if (xy.rows() != z.size() || weights.size() != z.size() || z.size() == 0)
    throw std::invalid_argument("areal: expected one height and one weight for every point");
  if (!xy.allFinite() || !z.allFinite() || !weights.allFinite())
    throw std::invalid_argument("areal: expected finite numbers");
  if (weights.minCoeff() < 0.0 || !(weights.sum() > 0.0))
    throw std::invalid_argument("areal: expected weights of at least 0, not all of them 0");
}

VectorXd heights_above_plane(const Eigen::MatrixX2d& xy, const VectorXd& z, const VectorXd& share) {
  const Eigen::RowVector2d centre = share.transpose() * xy;
  const Eigen::MatrixX2d shifted = xy.rowwise() - centre;
  const double size = shifted.cwiseAbs().maxCoeff();
  if (!(size > 0.0)) throw std::invalid_argument("areal: the points do not fix a plane");
  Eigen::MatrixX3d terms(z.size(), 3);
  terms << VectorXd::Ones(z.size()), shifted / size;
  const VectorXd root = share.cwiseSqrt();
  const Eigen::MatrixX3d weighted = root.asDiagonal() * terms;
  // A strip a thousand million times longer than wide counts as a line.
  const auto fit = least_squares(weighted, VectorXd(root.array() * z.array()), 1e-9);
  if (fit.rank < 3) throw std::invalid_argument("areal: the points do not fix a plane");
  return z - terms * fit.x;
}

}  // namespace

Areal areal(const Eigen::MatrixX2d& xy, const VectorXd& z, const VectorXd& weights,
            const ArealOptions& options) {
  check(xy, z, weights);
  const VectorXd share = weights / weights.sum();
  VectorXd h = z;
  if (options.reference == ArealReference::Plane) h = heights_above_plane(xy, z, share);
  if (options.reference == ArealReference::Mean) h.array() -= share.dot(z);
  Areal result;
  result.Sa = share.dot(h.cwiseAbs());
  result.Sq = std::sqrt(share.dot(h.cwiseAbs2()));
  result.Sp = h.maxCoeff();
  result.Sv = -h.minCoeff();
  result.Sz = result.Sp + result.Sv;
  if (result.Sq > 0.0) {
    const Eigen::ArrayXd unit = h.array() / result.Sq;
    result.Ssk = (share.array() * unit.cube()).sum();
    result.Sku = (share.array() * unit.square().square()).sum();
  }
  return result;
}

}  // namespace abbe::errors::metrology
