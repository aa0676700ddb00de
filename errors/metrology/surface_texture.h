#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::errors::metrology {

/// Heights along a line, a place every `step`.
struct Profile {
  double step = 0.0;  ///< mm, > 0
  Eigen::VectorXd z;  ///< (n) mm
};

/// The mean line of a profile: its heights through the Gaussian profile filter (ISO 16610-21).
/// The weight at a distance d is exp(-pi (d / (alpha N))^2), alpha^2 = ln 2 / pi, N the nesting
/// index, up to d = N; what lies beyond is 1e-7 of the weight. A wave of length N passes by half,
/// one of N / 2 by 6.25 %, one of 2 N by 84.09 %. Within N of an end a line is fitted with these
/// weights (ISO 16610-28, moments up to the first retained), so a straight line passes whole up to
/// the ends; elsewhere that is the weighted mean.
/// Bound: N or more from the ends a wave of length N / r passes to within 2^-(n - r)^2 + 2e-7 of
/// the exact share, where an index has n > 2 r steps (15 pm of a wave of 1 um for r = 1, n = 5; 0.2
/// pm from n = 6).
/// Costs n (2 N / step + 1) multiplications, n^2 at most.
/// @return (n) mm
/// @throws std::invalid_argument for a step or nesting index not positive, or heights not finite
Eigen::VectorXd mean_line(const Profile& profile, double nesting_index);

/// The least-squares straight line of a profile (n), mm.
Eigen::VectorXd straight_line(const Profile& profile);

/// A setting class of ISO 21920-3: what an evaluation has unless it is said.
struct SettingClass {
  const char* name;
  double Nic, section, evaluation;  ///< mm
  double Nis, widest_step;          ///< mm
};
std::span<const SettingClass> setting_classes();

/// The class of that nesting index Nic, else of the nearest one, by their ratio.
const SettingClass& setting_class(double Nic);

/// What of a profile is evaluated.
struct EvaluationLength {
  double from = 0.0;     ///< mm from the first place
  double section = 0.0;  ///< mm, section length lsc
  int sections = 1;      ///< nsc
};

/// Parameters of ISO 21920-2 of one profile (the letter P, W or R goes before each name), mm but
/// for shapes and gradient. The formulas are those of ISO 4287:1997, 4.1.1 (p), 4.1.2 (v), 4.1.3
/// (z), 4.1.5 (t), 4.2.1 to 4.2.4 (a, q, sk, ku), 4.3.1 (sm) and 4.4.1 (dq); ISO 21920-2 takes all
/// but p, v, z and zx over the evaluation length at once, where those were means over sections.
struct ProfileParameters {
  double a = 0.0;            ///< arithmetic mean height: mean of |z| over the evaluation length
  double q = 0.0;            ///< root mean square height, over the evaluation length
  std::optional<double> sk;  ///< skewness, the same; none where q is 0
  std::optional<double> ku;  ///< kurtosis, the same
  double t = 0.0;            ///< total height: highest less lowest of the evaluation length
  double p = 0.0;            ///< mean peak height: mean over the sections of the highest place
  double v = 0.0;            ///< mean pit depth: mean over the sections of the lowest, positive
  double z = 0.0;            ///< maximum height: p + v
  double zx = 0.0;           ///< largest of the sections' maximum heights
  std::optional<double> sm;  ///< mean profile element spacing, none of fewer than one element
  double dq = 0.0;           ///< root mean square gradient, mm / mm
};

/// Heights count from zero as they are. Means are sums over the places (each stands for a step).
/// An element is a hill followed by a dale, or a dale by a hill: parts beyond 10 % of p above and
/// 10 % of v below the mean line, so that smaller ones count with their neighbours. It runs from
/// crossing to crossing, found once from the left (the first crossing between a hill and a dale)
/// and once from the right; sm is the mean of both. Gradients are those of the seven places about
/// each (order 6), ends of the profile left out.
/// Bound: of a sine of amplitude A and m >= 10 places a wave, over whole waves, q is exact to
/// rounding, a within 0.4 (pi / m)^2 of 2 A / pi, relative; sm within a step / number of
/// elements, dq within (2 pi / m)^6 / 140 of sqrt(2) pi A / wave, relative.
/// @throws std::invalid_argument if less than a place or anything beyond the profile is evaluated
ProfileParameters parameters(const Profile& profile, const EvaluationLength& evaluation);

struct TextureOptions {
  double Nic = 0.8;                ///< mm, between waviness and roughness
  std::optional<double> Nis = {};  ///< mm, below it all is smoothed; else that of the class of Nic
  int sections = 5;                ///< of the length Nic, fewer where not so many fit
  Eigen::Index places = 100'000;   ///< at most
};

/// A line evaluated as ISO 21920 asks.
struct ProfileTexture {
  double Nis = 0.0;            ///< mm, as used
  double requested_Nis = 0.0;  ///< mm, less than `Nis` where the places would not have sufficed
  double length = 0.0;         ///< mm, traced
  Profile primary;             ///< through the S-filter Nis, less the `line`
  Eigen::VectorXd line;        ///< (n) mm, that was taken away as form
  Eigen::VectorXd waviness;    ///< (n) mm, the primary profile's mean line of Nic
  Eigen::VectorXd roughness;   ///< (n) mm, the primary profile less it
  EvaluationLength whole;      ///< of P and W: the length that was traced as one section
  EvaluationLength sections;   ///< of R: in the middle of it, so that ends tell least
  double run_in = 0.0;         ///< mm, of the trace before and after that
  ProfileParameters P, W, R;
};

/// Evaluates heights z over the way s along a line, straight between them: places every Nis / 5
/// (more where that were more than `places`: then Nis is raised to five of their steps), S-filter
/// Nis, the least-squares line as F-operation, mean line Nic as waviness, what is left as
/// roughness. All of both ends is used, by the end effects' treatment of `mean_line`.
/// Where less than one section fits, the whole is one.
/// @param s  (m >= 2) mm, rising, not all equal
/// @throws std::invalid_argument if sizes differ, for numbers not finite or not rising
ProfileTexture profile_texture(const Eigen::VectorXd& s, const Eigen::VectorXd& z,
                               const TextureOptions& options);

/// From where heights count.
enum class ArealReference { Plane, Mean, None };

struct ArealOptions {
  ArealReference reference = ArealReference::Plane;  ///< least squares, weighted; None: as given
};

/// Height parameters of ISO 25178-2, mm but for the two shapes.
struct Areal {
  double Sa = 0.0;            ///< mean of |z|
  double Sq = 0.0;            ///< root of the mean of z^2
  double Sp = 0.0;            ///< highest peak above the reference
  double Sv = 0.0;            ///< deepest pit below it, positive
  double Sz = 0.0;            ///< Sp + Sv
  std::optional<double> Ssk;  ///< skewness, none where Sq is 0
  std::optional<double> Sku;  ///< kurtosis, 3 of a normal distribution; the same
};

/// Height parameters of scattered points, each standing for an area; means are weighted by it. The
/// plane is that of least squares in z. No filter is applied.
/// @param xy       (n x 2) mm
/// @param z        (n) mm
/// @param weights  (n) >= 0, some > 0
/// @throws std::invalid_argument if sizes differ, for numbers not finite, or where the points do
/// not
///         fix a plane that is wanted
Areal areal(const Eigen::MatrixX2d& xy, const Eigen::VectorXd& z, const Eigen::VectorXd& weights,
            const ArealOptions& options = {});

}  // namespace abbe::errors::metrology
