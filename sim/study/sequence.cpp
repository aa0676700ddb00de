#include "sim/study/sequence.h"

#include <stdexcept>
#include <string>
#include <vector>

#include <boost/random/sobol.hpp>

#include "kinematics/hash.h"

namespace abbe::sim::study {
namespace {

constexpr int most_dimensions = 3600;
constexpr std::uint64_t most_points = std::uint64_t(1) << 52;

/// Draws of one point, dimension by dimension.
class Stream {
 public:
  Stream(std::uint64_t seed, std::uint64_t point) : state_(split_mix::stream(seed, point)) {}
  std::uint64_t next() { return split_mix::mixed(state_ += split_mix::golden); }

 private:
  std::uint64_t state_;
};

double within_unit(std::uint64_t bits) { return (double(bits >> 12) + 0.5) * 0x1p-52; }

void draw_random(const Sequence& sequence, std::uint64_t first, Eigen::MatrixXd& u) {
  for (Eigen::Index k = 0; k < u.cols(); ++k) {
    Stream stream(sequence.seed, first + std::uint64_t(k));
    for (Eigen::Index d = 0; d < u.rows(); ++d) u(d, k) = within_unit(stream.next());
  }
}

void draw_sobol(const Sequence& sequence, std::uint64_t first, Eigen::MatrixXd& u) {
  Stream stream(sequence.seed, most_points);  // a number that no random point has
  std::vector<std::uint64_t> shift(std::size_t(u.rows()));
  for (std::uint64_t& word : shift) word = stream.next();
  boost::random::sobol engine(shift.size());  // its point 0 is number 1: it skips the origin
  if (first > 0) engine.seed(first - 1);      // jumps by the bits of the number's Gray code
  for (Eigen::Index k = 0; k < u.cols(); ++k) {
    const bool origin = first == 0 && k == 0;
    for (Eigen::Index d = 0; d < u.rows(); ++d)
      u(d, k) = within_unit((origin ? 0 : engine()) ^ shift[std::size_t(d)]);
  }
}

}  // namespace

Eigen::MatrixXd points(const Sequence& sequence, std::uint64_t first, Eigen::Index count) {
  if (sequence.dimensions < 1 || sequence.dimensions > most_dimensions)
    throw std::invalid_argument("points have 1 to " + std::to_string(most_dimensions) +
                                " dimensions, not " + std::to_string(sequence.dimensions));
  if (count < 0 || first > most_points || std::uint64_t(count) > most_points - first)
    throw std::invalid_argument("a sequence has at most 2^52 points");
  Eigen::MatrixXd u(sequence.dimensions, count);
  if (sequence.sampling == Sampling::Random) draw_random(sequence, first, u);
  if (sequence.sampling == Sampling::Sobol) draw_sobol(sequence, first, u);
  return u;
}

}  // namespace abbe::sim::study
