#include "errors/metrology/surface_texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "kinematics/bad_input.h"
#include "kinematics/decompositions.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using Eigen::Index;
using Eigen::VectorXd;
using units::um;

/// Returns the weights of the filter at 0, 1, 2 ... steps from the point.
/// @param max_count  maximum number of weights
VectorXd profile_weights(double step, double nesting_index, Index max_count) {
  const double variance = nesting_index * nesting_index * std::numbers::ln2 /
                          (2.0 * std::numbers::pi * std::numbers::pi);
  // Weights beyond one nesting index are below 1e-7 and are omitted.
  const double half_width = std::min(nesting_index / step * (1.0 + 1e-12), double(max_count - 1));
  VectorXd weight(Index(half_width) + 1);
  for (Index k = 0; k < weight.size(); ++k)
    weight[k] = std::exp(-0.5 * double(k) * double(k) * step * step / variance);
  return weight;
}

/// Fit of lines to the heights with the weights of the filter, for points whose window extends
/// beyond the profile. Moments of the weights are differences of cumulative sums, so a window costs
/// only the sums over its heights.
class WindowFit {
 public:
  WindowFit(const VectorXd& z, const VectorXd& weight) : z_(z), half_width_(weight.size() - 1) {
    weight_.resize(2 * half_width_ + 1);
    weight_ << weight.tail(half_width_).reverse(), weight;
    const VectorXd d =
        VectorXd::LinSpaced(2 * half_width_ + 1, -double(half_width_), double(half_width_));
    first_moment_ = weight_.cwiseProduct(d);
    const VectorXd second_moment = first_moment_.cwiseProduct(d);
    sums_.setZero(2 * half_width_ + 2, 3);
    for (Index j = 0; j < weight_.size(); ++j)
      sums_.row(j + 1) =
          sums_.row(j) + Eigen::RowVector3d(weight_[j], first_moment_[j], second_moment[j]);
  }

  /// Returns the value at point i of the line fitted about it.
  double value_at(Index i) const {
    const Index from = std::max(Index(0), i - half_width_),
                to = std::min(z_.size(), i + half_width_ + 1);
    const Index window = from - i + half_width_, count = to - from;
    const Eigen::RowVector3d m = sums_.row(window + count) - sums_.row(window);
    const double z0 = weight_.segment(window, count).dot(z_.segment(from, count));
    const double z1 = first_moment_.segment(window, count).dot(z_.segment(from, count));
    const double determinant = m[0] * m[2] - m[1] * m[1];
    // A single point has no slope.
    return determinant > 0.0 ? (m[2] * z0 - m[1] * z1) / determinant : z0 / m[0];
  }

 private:
  const VectorXd& z_;
  Index half_width_;
  VectorXd weight_,
      first_moment_;       // over the window: weights, and weights times the distance in steps
  Eigen::MatrixX3d sums_;  // cumulative sums of weights times 1, distance, its square
};

/// Range of points of a profile.
struct PointRange {
  Index first, end;  // end is exclusive
};

/// Returns the points of section k of an evaluation length, or of the whole length for k = -1.
PointRange section_points(const Profile& profile, const EvaluationLength& e, int k) {
  const double from = e.from + std::max(k, 0) * e.section;
  const double to = k < 0 ? e.from + e.sections * e.section : from + e.section;
  // A point exactly on a boundary belongs to the section that begins there.
  const auto point_index = [&](double distance) {
    return Index(std::ceil(distance / profile.step - 1e-6));
  };
  const PointRange points{std::max(Index(0), point_index(from)),
                          std::min(profile.z.size(), point_index(to))};
  require(points.end > points.first, "profile: expected at least one point in every section");
  return points;
}

/// Crossings of the mean line, in steps: the first and the last one between each hill and the
/// neighbouring dale.
struct Crossings {
  std::vector<double> first, last;
};

/// Returns the crossings between hills of at least a height and dales of at least a depth.
Crossings significant_crossings(const VectorXd& z, double min_hill_height, double min_dale_depth) {
  Crossings result;
  Index previous = -1;  // last significant point so far
  for (Index i = 0; i < z.size(); ++i) {
    if (!(z[i] > min_hill_height) && !(z[i] < -min_dale_depth)) continue;
    if (previous >= 0 && (z[i] > 0.0) != (z[previous] > 0.0)) {
      const auto crossing = [&](Index k) { return double(k) + z[k] / (z[k] - z[k + 1]); };
      const auto crosses = [&](Index k) { return (z[k] > 0.0) != (z[k + 1] > 0.0); };
      Index first = previous, last = i - 1;
      while (!crosses(first)) ++first;
      while (!crosses(last)) --last;
      result.first.push_back(crossing(first));
      result.last.push_back(crossing(last));
    }
    previous = i;
  }
  return result;
}

/// Returns the mean length of the profile elements, in steps.
std::optional<double> element_spacing(const VectorXd& z, double min_hill_height,
                                      double min_dale_depth) {
  const Crossings crossings = significant_crossings(z, min_hill_height, min_dale_depth);
  const std::size_t n = crossings.first.size();
  // An element extends over three crossings; neighbouring elements share one.
  if (n < 3) return std::nullopt;
  const std::size_t elements = (n - 1) / 2;
  const double from_left = crossings.first[2 * elements] - crossings.first[0];
  const double from_right = crossings.last[n - 1] - crossings.last[n - 1 - 2 * elements];
  return 0.5 * (from_left + from_right) / double(elements);
}

/// Returns the root mean square gradient.
double rms_gradient(const Profile& profile, const PointRange& points) {
  const VectorXd& z = profile.z;
  // The sixth-order difference needs three points on either side.
  const Index first = std::max(points.first, Index(3));
  const Index end = std::min(points.end, z.size() - 3);
  double squares = 0.0;
  for (Index i = first; i < end; ++i) {
    const double slope =
        (z[i + 3] - z[i - 3] - 9.0 * (z[i + 2] - z[i - 2]) + 45.0 * (z[i + 1] - z[i - 1])) /
        (60.0 * profile.step);
    squares += slope * slope;
  }
  return end > first ? std::sqrt(squares / double(end - first)) : 0.0;
}

constexpr std::array setting_classes = {SettingClass{"Sc1", 0.08, 0.08, 0.4, 2.5 * um, 0.5 * um},
                                        SettingClass{"Sc2", 0.25, 0.25, 1.25, 2.5 * um, 0.5 * um},
                                        SettingClass{"Sc3", 0.8, 0.8, 4.0, 2.5 * um, 0.5 * um},
                                        SettingClass{"Sc4", 2.5, 2.5, 12.5, 8.0 * um, 1.5 * um},
                                        SettingClass{"Sc5", 8.0, 8.0, 40.0, 25.0 * um, 5.0 * um}};

/// Returns n heights at equal steps, interpolated linearly.
VectorXd resample(const VectorXd& s, const VectorXd& z, double step, Index n) {
  VectorXd heights(n);
  Index k = 0;
  for (Index i = 0; i < n; ++i) {
    const double position = std::min(s[0] + double(i) * step, s[s.size() - 1]);
    while (k + 2 < s.size() && s[k + 1] < position) ++k;
    const double width = s[k + 1] - s[k];
    const double u = width > 0.0 ? std::clamp((position - s[k]) / width, 0.0, 1.0) : 1.0;
    heights[i] = std::lerp(z[k], z[k + 1], u);
  }
  return heights;
}

void check_line(const VectorXd& s, const VectorXd& z, const TextureOptions& options) {
  require(s.size() == z.size() && s.size() >= 2, "profile_texture: expected at least two points");
  require(s.allFinite() && z.allFinite(), "profile_texture: expected finite numbers");
  for (Index i = 0; i + 1 < s.size(); ++i)
    require(s[i + 1] >= s[i], "profile_texture: expected increasing positions");
  require(s[s.size() - 1] > s[0], "profile_texture: expected a line longer than 0");
  require(std::isfinite(options.Nic) && options.Nic > 0.0, "profile_texture: Nic must be positive");
  require(!options.Nis || (std::isfinite(*options.Nis) && *options.Nis > 0.0),
          "profile_texture: Nis must be positive");
  require(options.sections >= 1 && options.places >= 16,
          "profile_texture: expected at least 1 section and at least 16 points");
}

/// Returns sections centred in the length, or the length as one section if none fits.
EvaluationLength central_sections(double length, double section, int requested_count) {
  const int max_sections = int(std::min(1e6, std::floor(length / section * (1.0 + 1e-9))));
  if (max_sections < 1) return {0.0, length, 1};
  const int sections = std::min(requested_count, max_sections);
  return {0.5 * (length - sections * section), section, sections};
}

}  // namespace

VectorXd mean_line(const Profile& profile, double nesting_index) {
  const VectorXd& z = profile.z;
  require(std::isfinite(profile.step) && profile.step > 0.0, "mean_line: step must be positive");
  require(std::isfinite(nesting_index) && nesting_index > 0.0,
          "mean_line: the nesting index must be positive");
  require(z.allFinite(), "mean_line: expected finite heights");
  require(z.size() > 0, "mean_line: expected at least one height");
  const VectorXd weight = profile_weights(profile.step, nesting_index, z.size());
  const Index k = weight.size() - 1, inner_count = z.size() - 2 * k;
  VectorXd line(z.size());
  if (inner_count > 0) {
    VectorXd sum = weight[0] * z.segment(k, inner_count);
    for (Index j = 1; j <= k; ++j)
      sum += weight[j] * (z.segment(k - j, inner_count) + z.segment(k + j, inner_count));
    double weight_sum = weight[0];
    for (Index j = 1; j <= k; ++j) weight_sum += 2.0 * weight[j];
    line.segment(k, inner_count) = sum / weight_sum;
  }
  const Index end = inner_count > 0 ? k : z.size();
  const WindowFit fit(z, weight);
  for (Index i = 0; i < end; ++i) {
    line[i] = fit.value_at(i);
    if (inner_count > 0) line[z.size() - 1 - i] = fit.value_at(z.size() - 1 - i);
  }
  return line;
}

VectorXd straight_line(const Profile& profile) {
  const Index n = profile.z.size();
  if (n < 2) return profile.z;
  const double centre = 0.5 * double(n - 1);
  double mean = 0.0, moment = 0.0, squares = 0.0;
  for (Index i = 0; i < n; ++i) mean += profile.z[i] / double(n);
  for (Index i = 0; i < n; ++i) {
    const double d = double(i) - centre;
    moment += d * (profile.z[i] - mean);
    squares += d * d;
  }
  VectorXd line(n);
  for (Index i = 0; i < n; ++i) line[i] = mean + moment / squares * (double(i) - centre);
  return line;
}

const SettingClass& setting_class(double Nic) {
  const auto ratio = [&](const SettingClass& candidate) {
    return std::abs(std::log(candidate.Nic / Nic));
  };
  return *std::min_element(
      setting_classes.begin(), setting_classes.end(),
      [&](const SettingClass& a, const SettingClass& b) { return ratio(a) < ratio(b); });
}

ProfileParameters parameters(const Profile& profile, const EvaluationLength& evaluation) {
  require(evaluation.sections >= 1 && evaluation.section > 0.0 && evaluation.from >= 0.0,
          "profile: expected at least one section within the profile");
  const PointRange evaluated = section_points(profile, evaluation, -1);
  const VectorXd z = profile.z.segment(evaluated.first, evaluated.end - evaluated.first);
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
      const double normalised = height / result.q;
      cubes += normalised * normalised * normalised / n;
      fourths += normalised * normalised * normalised * normalised / n;
    }
    result.sk = cubes;
    result.ku = fourths;
  }
  result.t = z.maxCoeff() - z.minCoeff();
  for (int k = 0; k < evaluation.sections; ++k) {
    const PointRange points = section_points(profile, evaluation, k);
    const auto section = profile.z.segment(points.first, points.end - points.first);
    const double highest = section.maxCoeff(), lowest = section.minCoeff();
    result.p += highest / evaluation.sections;
    result.v -= lowest / evaluation.sections;
    result.zx = std::max(result.zx, highest - lowest);
  }
  result.z = result.p + result.v;
  // The default discrimination of ISO 21920-2, a fraction of mean peak height and mean pit depth.
  constexpr double min_fraction = 0.1;
  if (const auto spacing = element_spacing(z, min_fraction * std::max(result.p, 0.0),
                                           min_fraction * std::max(result.v, 0.0)))
    result.sm = *spacing * profile.step;
  result.dq = rms_gradient(profile, evaluated);
  return result;
}

ProfileTexture profile_texture(const VectorXd& s, const VectorXd& z,
                               const TextureOptions& options) {
  check_line(s, z, options);
  constexpr double points_per_index = 5.0;
  ProfileTexture result;
  result.length = s[s.size() - 1] - s[0];
  result.requested_Nis = options.Nis.value_or(setting_class(options.Nic).Nis);
  const double steps = std::min(std::ceil(result.length * points_per_index / result.requested_Nis),
                                double(options.places - 1));
  // 16 points or more: the gradient needs seven, and sections must not be empty.
  const Index n = Index(std::max(steps, 15.0)) + 1;
  result.primary.step = result.length / double(n - 1);
  // 1e-9: rounding must not raise the nesting index.
  result.Nis =
      std::max(result.requested_Nis, points_per_index * result.primary.step * (1.0 - 1e-9));
  const Profile traced_profile{result.primary.step, resample(s, z, result.primary.step, n)};
  result.primary.z = mean_line(traced_profile, result.Nis);
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

void check_areal_points(const Eigen::MatrixX2d& xy, const VectorXd& z, const VectorXd& weights) {
  if (xy.rows() != z.size() || weights.size() != z.size() || z.size() == 0)
    throw std::invalid_argument("areal: expected one height and one weight per point");
  if (!xy.allFinite() || !z.allFinite() || !weights.allFinite())
    throw std::invalid_argument("areal: expected finite numbers");
  if (weights.minCoeff() < 0.0 || !(weights.sum() > 0.0))
    throw std::invalid_argument("areal: expected weights of at least 0, not all of them 0");
}

/// Returns the heights above the weighted least-squares plane.
VectorXd heights_above_plane(const Eigen::MatrixX2d& xy, const VectorXd& z,
                             const VectorXd& weights) {
  const Eigen::RowVector2d centre = weights.transpose() * xy;
  const Eigen::MatrixX2d shifted = xy.rowwise() - centre;
  const double size = shifted.cwiseAbs().maxCoeff();
  if (!(size > 0.0)) throw std::invalid_argument("areal: the points do not define a plane");
  Eigen::MatrixX3d terms(z.size(), 3);
  terms << VectorXd::Ones(z.size()), shifted / size;
  const VectorXd root = weights.cwiseSqrt();
  const Eigen::MatrixX3d weighted = root.asDiagonal() * terms;
  // 1e-9: a strip more than 1e9 times as long as wide counts as a line.
  const auto fit = least_squares(weighted, VectorXd(root.array() * z.array()), 1e-9);
  if (fit.rank < 3) throw std::invalid_argument("areal: the points do not define a plane");
  return z - terms * fit.x;
}

}  // namespace

ArealParameters areal(const Eigen::MatrixX2d& xy, const VectorXd& z, const VectorXd& weights,
                      const ArealOptions& options) {
  check_areal_points(xy, z, weights);
  const VectorXd relative_weights = weights / weights.sum();
  VectorXd h = z;
  if (options.reference == ArealReference::Plane) h = heights_above_plane(xy, z, relative_weights);
  if (options.reference == ArealReference::Mean) h.array() -= relative_weights.dot(z);
  ArealParameters result;
  result.Sa = relative_weights.dot(h.cwiseAbs());
  result.Sq = std::sqrt(relative_weights.dot(h.cwiseAbs2()));
  result.Sp = h.maxCoeff();
  result.Sv = -h.minCoeff();
  result.Sz = result.Sp + result.Sv;
  if (result.Sq > 0.0) {
    const Eigen::ArrayXd normalised = h.array() / result.Sq;
    result.Ssk = (relative_weights.array() * normalised.cube()).sum();
    result.Sku = (relative_weights.array() * normalised.square().square()).sum();
  }
  return result;
}

}  // namespace abbe::errors::metrology
