#pragma once

#include <cstdint>

#include <Eigen/Core>

/// Learned regression models, trained by dlib and stored as plain numbers. Inputs and outputs
/// should be of order 1 (scaled to standard deviation 1), as thermal_model.h provides them.
namespace abbe::errors::identification {

/// Sum of kernels: bias + sum_i weight_i exp(-gamma |z - support_i|^2).
struct KernelSum {
  Eigen::MatrixXd support;  ///< (s x m)
  Eigen::VectorXd weight;   ///< (s)
  double bias = 0.0;
  double gamma = 1.0;
};
/// Returns the sum of kernels at inputs z (m).
double value(const KernelSum& sum, const Eigen::VectorXd& z);

struct SupportVectorOptions {
  double gamma = 0.1;
  double cost = 10.0;      ///< of a deviation of 1 beyond the tube
  double epsilon = 0.05;   ///< half width of the tube in which deviations have no cost
  double accuracy = 1e-3;  ///< tolerance of the optimality conditions
};
/// Trains a support vector regression on rows Z (n x m) with outputs y (n).
/// @throws std::invalid_argument for no rows, shapes that disagree, numbers that are not finite, or
///         an option that is not positive
KernelSum fit_support_vectors(const Eigen::MatrixXd& Z, const Eigen::VectorXd& y,
                              const SupportVectorOptions& options = {});

struct KernelRidgeOptions {
  double gamma = 0.1;
  double penalty = 1e-3;  ///< minimises sum of squares + n penalty (|f|^2 + bias^2)
  int max_support = 400;  ///< maximum number of support rows, the most independent ones
};
/// Trains a kernel ridge regression. @throws as above
KernelSum fit_kernel_ridge(const Eigen::MatrixXd& Z, const Eigen::VectorXd& y,
                           const KernelRidgeOptions& options = {});

/// Network with one hidden layer: out_bias + out . tanh(in z + in_bias).
struct Network {
  Eigen::MatrixXd in;       ///< (h x m)
  Eigen::VectorXd in_bias;  ///< (h)
  Eigen::VectorXd out;      ///< (h)
  double out_bias = 0.0;
};
/// Returns the output of the network for inputs z (m).
double value(const Network& network, const Eigen::VectorXd& z);

struct NetworkOptions {
  int hidden = 5;       ///< number of nodes of the hidden layer
  double decay = 1e-3;  ///< minimises mean square + decay (|in|^2 + |out|^2)
  int starts = 3;       ///< number of random starts; the best result is used
  int max_iterations = 500;
  std::uint64_t seed = 1;
};
/// Trains a network by quasi-Newton (L-BFGS) over all rows at once, with the exact gradient. Finds
/// a local minimum, the same one for the same seed.
/// @throws as above
Network fit_network(const Eigen::MatrixXd& Z, const Eigen::VectorXd& y,
                    const NetworkOptions& options = {});

}  // namespace abbe::errors::identification
