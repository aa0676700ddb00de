#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::errors::metrology {

/// Heights along a line, one point every `step`.
struct Profile {
  double step = 0.0;  ///< mm, > 0
  Eigen::VectorXd z;  ///< (n) mm
};

/// Returns the mean line of a profile by the Gaussian profile filter (ISO 16610-21). The weight at
/// a distance d up to N is exp(-pi (d / (alpha N))^2), where N is the nesting index and alpha^2 =
/// ln 2 / pi; the omitted weights are 1e-7 of their sum. A wave of length N is transmitted by half,
/// one of N / 2 by 6.25 %, one of 2 N by 84.09 %. Within N of an end a line is fitted with these
/// weights (ISO 16610-28, moments up to the first retained), so a straight line is unchanged up to
/// the ends. Elsewhere the fit equals the weighted mean.
/// Bound: N or more from the ends a wave of length N / r is transmitted to within 2^-(n - r)^2 +
/// 2e-7 of the exact ratio if the nesting index has n > 2 r steps (15 pm of a wave of 1 um for r =
/// 1, n = 5; 0.2 pm from n = 6).
/// Cost: n (2 N / step + 1) multiplications, at most n^2.
/// @return (n) mm
/// @throws std::invalid_argument for a step or nesting index that is not positive, or heights that
///         are not finite
Eigen::VectorXd mean_line(const Profile& profile, double nesting_index);

/// Returns the least-squares straight line of a profile (n), mm.
Eigen::VectorXd straight_line(const Profile& profile);

/// Setting class of ISO 21920-3: default settings of an evaluation.
struct SettingClass {
  const char* name;
  double Nic, section, evaluation;  ///< mm
  double Nis, widest_step;          ///< mm
};
/// Returns the class of a nesting index Nic, or the nearest by ratio.
const SettingClass& setting_class(double Nic);

/// Evaluation length of a profile.
struct EvaluationLength {
  double from = 0.0;     ///< mm from the first point
  double section = 0.0;  ///< mm, section length lsc
  int sections = 1;      ///< number of sections nsc
};

/// Parameters of ISO 21920-2 of one profile (prefixed by P, W or R), mm except shapes and gradient.
/// The formulas are those of ISO 4287:1997, 4.1.1 (p), 4.1.2 (v), 4.1.3 (z), 4.1.5 (t), 4.2.1 to
/// 4.2.4 (a, q, sk, ku), 4.3.1 (sm) and 4.4.1 (dq); ISO 21920-2 evaluates all but p, v, z and zx
/// over the whole evaluation length; in ISO 4287 they were means over sections.
struct ProfileParameters {
  double a = 0.0;            ///< arithmetic mean height: mean of |z| over the evaluation length
  double q = 0.0;            ///< root mean square height, over the evaluation length
  std::optional<double> sk;  ///< skewness over the evaluation length; empty if q is 0
  std::optional<double> ku;  ///< kurtosis over the evaluation length; empty if q is 0
  double t = 0.0;            ///< total height: highest minus lowest point of the evaluation length
  double p = 0.0;            ///< mean peak height: mean over the sections of the highest point
  double v = 0.0;            ///< mean pit depth: mean over the sections of the lowest point,
                             ///< positive
  double z = 0.0;            ///< maximum height: p + v
  double zx = 0.0;           ///< largest maximum height of a section
  std::optional<double> sm;  ///< mean profile element spacing; empty for fewer than one element
  double dq = 0.0;           ///< root mean square gradient, mm / mm
};

/// Returns the parameters of a profile whose mean line is zero. Means are sums over the points,
/// each of which represents a step. An element is a hill followed by a dale, or a dale by a hill.
/// Hills rise above 10 % of p, dales fall below 10 % of v; smaller parts belong to their
/// neighbours. Elements extend from crossing to crossing, determined once from the left (the first
/// crossing between a hill and a dale) and once from the right; sm is the mean of both. Gradients
/// use seven points (order 6), without the ends of the profile.
/// Bound: for a sine of amplitude A and m >= 10 points per wave, over whole waves, q is exact to
/// rounding, a within 0.4 (pi / m)^2 of 2 A / pi, relative; sm within a step / number of elements,
/// dq within (2 pi / m)^6 / 140 of sqrt(2) pi A / wave, relative.
/// @throws std::invalid_argument if a section has no point, or the length exceeds the profile
ProfileParameters parameters(const Profile& profile, const EvaluationLength& evaluation);

/// Options of the evaluation of a line.
struct TextureOptions {
  double Nic = 0.8;                ///< mm, nesting index between waviness and roughness
  std::optional<double> Nis = {};  ///< mm, nesting index of the S-filter; empty: that of the class
                                   ///< of Nic
  int sections = 5;                ///< number of sections of length Nic; fewer if they do not fit
  Eigen::Index places = 100'000;   ///< maximum number of points
};

/// Evaluation of a line by ISO 21920.
struct ProfileTexture {
  double Nis = 0.0;            ///< mm, used
  double requested_Nis = 0.0;  ///< mm, less than `Nis` if `places` does not suffice for it
  double length = 0.0;         ///< mm, traced
  Profile primary;             ///< after the S-filter Nis, minus `line`
  Eigen::VectorXd line;        ///< (n) mm, removed as form
  Eigen::VectorXd waviness;    ///< (n) mm, mean line of the primary profile with Nic
  Eigen::VectorXd roughness;   ///< (n) mm, primary profile minus waviness
  EvaluationLength whole;      ///< of P and W: the traced length as one section
  EvaluationLength sections;  ///< of R: centred in the traced length, where the ends have the least
                              ///< influence
  double run_in = 0.0;        ///< mm, length traced before and after the sections
  ProfileParameters P, W, R;
};

/// Evaluates heights z at positions s along a line. They are interpolated linearly at steps of Nis
/// / 5; if this gives more than `places` points, the step is longer and Nis is raised to five
/// steps. Then follow the S-filter Nis, the least-squares line as F-operation, the mean line Nic as
/// waviness, and the remaining heights as roughness. The ends are included, by the end treatment of
/// `mean_line`. If no section fits, the whole length is one section.
/// @param s  (m >= 2) mm, not decreasing, not all equal
/// @throws std::invalid_argument if sizes differ, for numbers that are not finite, or for
/// decreasing s
ProfileTexture profile_texture(const Eigen::VectorXd& s, const Eigen::VectorXd& z,
                               const TextureOptions& options);

/// Reference of areal heights.
enum class ArealReference { Plane, Mean, None };

/// Options of areal height parameters.
struct ArealOptions {
  ArealReference reference = ArealReference::Plane;  ///< Plane: weighted least squares;
                                                     ///< Mean: weighted; None: zero
};

/// Height parameters of ISO 25178-2, mm except Ssk and Sku.
struct ArealParameters {
  double Sa = 0.0;            ///< mean of |z|
  double Sq = 0.0;            ///< root of the mean of z^2
  double Sp = 0.0;            ///< highest point above the reference
  double Sv = 0.0;            ///< deepest point below it, positive
  double Sz = 0.0;            ///< Sp + Sv
  std::optional<double> Ssk;  ///< skewness; empty if Sq is 0
  std::optional<double> Sku;  ///< kurtosis, 3 for a normal distribution; empty if Sq is 0
};

/// Returns the height parameters of scattered points. The weight of a point is the area that it
/// represents. The plane is fitted by least squares in z. No filter is applied.
/// @param xy       (n x 2) mm
/// @param z        (n) mm
/// @param weights  (n) >= 0, not all 0
/// @throws std::invalid_argument if sizes differ, for numbers that are not finite, or if the points
///         do not determine a required plane
ArealParameters areal(const Eigen::MatrixX2d& xy, const Eigen::VectorXd& z,
                      const Eigen::VectorXd& weights, const ArealOptions& options = {});

}  // namespace abbe::errors::metrology
