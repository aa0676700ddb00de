#include "errors/identification/learned.h"

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

// dlib is used header-only. Its check against the packaged library would require linking that
// library; BLAS and LAPACK, which its package enables, would make results depend on the installed
// versions.
#define DLIB_TEST_FOR_ODR_VIOLATIONS_H_
#include <dlib/assert.h>
#undef DLIB_USE_BLAS
#undef DLIB_USE_LAPACK
#include <dlib/optimization.h>
#include <dlib/svm.h>

#include "kinematics/bad_input.h"

namespace abbe::errors::identification {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Sample = dlib::matrix<double, 0, 1>;
using Kernel = dlib::radial_basis_kernel<Sample>;

void validate_training(const MatrixXd& Z, const VectorXd& y) {
  require(Z.rows() >= 1 && Z.cols() >= 1, "a learned model needs at least one row and one input");
  require(Z.rows() == y.size(), "inputs and readings differ in their number of rows");
  require(Z.allFinite() && y.allFinite(), "a learned model needs finite numbers");
}

Sample to_dlib(const VectorXd& v) {
  Sample sample(v.size());
  for (Index i = 0; i < v.size(); ++i) sample(i) = v(i);
  return sample;
}

VectorXd to_eigen(const Sample& sample) {
  VectorXd v(sample.size());
  for (Index i = 0; i < v.size(); ++i) v(i) = sample(i);
  return v;
}

std::vector<Sample> dlib_samples(const MatrixXd& Z) {
  std::vector<Sample> result;
  for (Index row = 0; row < Z.rows(); ++row) result.push_back(to_dlib(Z.row(row)));
  return result;
}

/// Converts a function trained by dlib.
KernelSum kernel_sum(const dlib::decision_function<Kernel>& f) {
  const auto s = static_cast<Index>(f.basis_vectors.size());
  const Index m = s ? static_cast<Index>(f.basis_vectors(0).size()) : 0;
  KernelSum sum{MatrixXd(s, m), VectorXd(s), -f.b, f.kernel_function.gamma};
  for (Index i = 0; i < s; ++i) {
    sum.support.row(i) = to_eigen(f.basis_vectors(i)).transpose();
    sum.weight(i) = f.alpha(i);
  }
  return sum;
}

template <typename Trainer>
KernelSum train_kernel_sum(const Trainer& trainer, const MatrixXd& Z, const VectorXd& y) {
  return kernel_sum(
      trainer.train(dlib_samples(Z), std::vector<double>(y.data(), y.data() + y.size())));
}

/// Loss of a network and its gradient with respect to all weights in one vector: in, in_bias, out,
/// out_bias.
class NetworkLoss {
 public:
  NetworkLoss(const MatrixXd& Z, const VectorXd& y, const NetworkOptions& options)
      : Z_(Z), y_(y), h_(options.hidden), decay_(options.decay) {}

  Index size() const { return h_ * (Z_.cols() + 2) + 1; }

  Network unpack(const Sample& w) const {
    const Index m = Z_.cols();
    const double* weights = &w(0);
    return {Eigen::Map<const MatrixXd>(weights, h_, m),
            Eigen::Map<const VectorXd>(weights + h_ * m, h_),
            Eigen::Map<const VectorXd>(weights + h_ * (m + 1), h_), w(h_ * (m + 2))};
  }

  double loss(const Sample& w) const {
    const Network net = unpack(w);
    return residual(net, hidden(net)).squaredNorm() / static_cast<double>(y_.size()) +
           decay_ * (net.in.squaredNorm() + net.out.squaredNorm());
  }

  Sample gradient(const Sample& w) const {
    const Network net = unpack(w);
    const MatrixXd t = hidden(net);
    const VectorXd r = residual(net, t) * (2.0 / static_cast<double>(y_.size()));
    // d tanh = 1 - tanh^2: derivative of the loss by the sum at each hidden node, for every row.
    const MatrixXd back =
        ((1 - t.array().square()).rowwise() * net.out.transpose().array()).colwise() * r.array();
    VectorXd g(size());
    const Index m = Z_.cols();
    const MatrixXd in = back.transpose() * Z_ + 2 * decay_ * net.in;
    g << Eigen::Map<const VectorXd>(in.data(), h_ * m), back.colwise().sum().transpose(),
        t.transpose() * r + 2 * decay_ * net.out, r.sum();
    return to_dlib(g);
  }

 private:
  MatrixXd hidden(const Network& net) const {
    const MatrixXd sum = (Z_ * net.in.transpose()).rowwise() + net.in_bias.transpose();
    return sum.unaryExpr([](double x) { return std::tanh(x); });
  }
  VectorXd residual(const Network& net, const MatrixXd& t) const {
    return ((t * net.out).array() + net.out_bias).matrix() - y_;
  }

  const MatrixXd& Z_;
  const VectorXd& y_;
  Index h_;
  double decay_;
};

}  // namespace

double value(const KernelSum& sum, const VectorXd& z) {
  double result = sum.bias;
  for (Index i = 0; i < sum.weight.size(); ++i)
    result +=
        sum.weight(i) * std::exp(-sum.gamma * (sum.support.row(i).transpose() - z).squaredNorm());
  return result;
}

KernelSum fit_support_vectors(const MatrixXd& Z, const VectorXd& y,
                              const SupportVectorOptions& options) {
  validate_training(Z, y);
  require(options.gamma > 0 && options.cost > 0 && options.epsilon > 0 && options.accuracy > 0,
          "options of the support vector model must be positive");
  dlib::svr_trainer<Kernel> trainer;
  trainer.set_kernel(Kernel(options.gamma));
  trainer.set_c(options.cost);
  trainer.set_epsilon_insensitivity(options.epsilon);
  trainer.set_epsilon(options.accuracy);
  return train_kernel_sum(trainer, Z, y);
}

KernelSum fit_kernel_ridge(const MatrixXd& Z, const VectorXd& y,
                           const KernelRidgeOptions& options) {
  validate_training(Z, y);
  require(options.gamma > 0 && options.penalty > 0 && options.max_support > 0,
          "options of kernel ridge regression must be positive");
  dlib::krr_trainer<Kernel> trainer;
  trainer.set_kernel(Kernel(options.gamma));
  // dlib's lambda is not per row, while `penalty` is.
  trainer.set_lambda(options.penalty * static_cast<double>(y.size()));
  trainer.set_max_basis_size(static_cast<unsigned long>(options.max_support));
  return train_kernel_sum(trainer, Z, y);
}

double value(const Network& network, const VectorXd& z) {
  double result = network.out_bias;
  const VectorXd sum = network.in * z + network.in_bias;
  for (Index i = 0; i < sum.size(); ++i) result += network.out(i) * std::tanh(sum(i));
  return result;
}

Network fit_network(const MatrixXd& Z, const VectorXd& y, const NetworkOptions& options) {
  validate_training(Z, y);
  require(options.hidden >= 1 && options.hidden <= 1000 && options.decay >= 0 &&
              std::isfinite(options.decay) && options.starts >= 1 && options.max_iterations >= 1,
          "an option of the neural network is out of range");
  const NetworkLoss loss(Z, y, options);
  std::mt19937_64 random(options.seed);
  Sample best;
  double min_loss = std::numeric_limits<double>::infinity();
  // The loss has local minima, so the best of several starts is used.
  for (int start = 0; start < options.starts; ++start) {
    Sample w(loss.size());
    // Uniform in +-0.5, computed from the raw bits: distributions of the standard library differ
    // between implementations.
    for (Index i = 0; i < loss.size(); ++i)
      w(i) = static_cast<double>(random() >> 11) * 0x1p-53 - 0.5;
    // 20 pairs of the quasi-Newton history; 1e-10 is far below the noise of temperature data.
    const double final_loss = dlib::find_min(
        dlib::lbfgs_search_strategy(20),
        dlib::objective_delta_stop_strategy(1e-10,
                                            static_cast<unsigned long>(options.max_iterations)),
        [&](const Sample& x) { return loss.loss(x); },
        [&](const Sample& x) { return loss.gradient(x); }, w,
        -std::numeric_limits<double>::infinity());
    if (final_loss < min_loss) {
      min_loss = final_loss;
      best = w;
    }
  }
  return loss.unpack(best);
}

}  // namespace abbe::errors::identification
