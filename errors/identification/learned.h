#pragma once

#include <cstdint>

#include <Eigen/Core>

/// Learned models, trained by dlib and kept as plain numbers. Inputs and outputs are meant to be of
/// the order of 1 (scaled to standard deviation 1), as thermal_model.h hands them over.
namespace abbe::errors::identification {

/// bias + sum_i weight_i exp(-gamma |z - support_i|^2)
struct KernelSum {
  Eigen::MatrixXd support;  ///< (s x m)
  Eigen::VectorXd weight;   ///< (s)
  double bias = 0.0;
  double gamma = 1.0;
};
double value(const KernelSum& sum, const Eigen::VectorXd& z);

struct SupportVectorOptions {
  double gamma = 0.1;
  double cost = 10.0;      ///< of a unit outside the tube
  double epsilon = 0.05;   ///< half width of the tube in which a deviation costs nothing
  double accuracy = 1e-3;  ///< of the optimality conditions
};
/// @throws std::invalid_argument for no rows, shapes that disagree, numbers that are not finite, an
///         option that is not positive
KernelSum fit_support_vectors(const Eigen::MatrixXd& Z, const Eigen::VectorXd& y,
                              const SupportVectorOptions& options = {});

struct KernelRidgeOptions {
  double gamma = 0.1;
  double penalty = 1e-3;  ///< sum of squares + n penalty (|f|^2 + bias^2)
  int max_support = 400;  ///< rows that carry the kernels, the most independent ones
};
/// @throws as above
KernelSum fit_kernel_ridge(const Eigen::MatrixXd& Z, const Eigen::VectorXd& y,
                           const KernelRidgeOptions& options = {});

/// out_bias + out . tanh(in z + in_bias)
struct Network {
  Eigen::MatrixXd in;       ///< (h x m)
  Eigen::VectorXd in_bias;  ///< (h)
  Eigen::VectorXd out;      ///< (h)
  double out_bias = 0.0;
};
double value(const Network& network, const Eigen::VectorXd& z);

struct NetworkOptions {
  int hidden = 5;
  double decay = 1e-3;  ///< min mean square + decay (|in|^2 + |out|^2)
  int starts = 3;       ///< from random weights; the best end is kept
  int max_iterations = 500;
  std::uint64_t seed = 1;
};
/// Quasi-Newton (L-BFGS) over all rows at once, gradient by the chain rule. A local minimum, the
/// same for the same seed.
/// @throws as above
Network fit_network(const Eigen::MatrixXd& Z, const Eigen::VectorXd& y,
                    const NetworkOptions& options = {});

}  // namespace abbe::errors::identification
