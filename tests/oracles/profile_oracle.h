#pragma once

#include <vector>

/// Profile parameters a second time: from the definitions, place by place, without any code of the
/// modules. Lengths in one unit, whatever it is.
namespace abbe::test {

/// The mean line of a profile: at every place a line through all heights within one nesting index,
/// weighted by the Gaussian, by weighted means about their own centre.
std::vector<double> brute_mean_line(const std::vector<double>& z, double step, double index);

struct BruteProfile {
  double a, q, sk, ku, t, p, v, z, zx, sm, dq;
};

/// Of the places first .. last (not included), in sections of equal numbers of places. `sm` walks
/// over the profile and the reversed profile as a machine of three states.
BruteProfile brute_parameters(const std::vector<double>& z, double step, int first, int last,
                              int sections);

}  // namespace abbe::test
