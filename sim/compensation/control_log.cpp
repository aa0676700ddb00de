#include "sim/compensation/control_log.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace abbe::sim::compensation {

Eigen::VectorXd column(const ControlLog& log, const std::string& name) {
  const auto found = std::find(log.names.begin(), log.names.end(), name);
  if (found == log.names.end()) {
    std::string there;
    for (const std::string& other : log.names) there += (there.empty() ? "" : ", ") + other;
    throw std::invalid_argument("the control reads no \"" + name + "\", it reads " +
                                (there.empty() ? "nothing" : there));
  }
  if (log.values.cols() != Eigen::Index(log.names.size()) || log.values.rows() != log.time_s.size())
    throw std::invalid_argument("a control log needs a value for each of its names and instants");
  return log.values.col(found - log.names.begin());
}

Eigen::Index row_at(const ControlLog& log, double time_s) {
  if (log.time_s.size() == 0)
    throw std::invalid_argument("a control log without rows was asked what it knows");
  if (std::isnan(time_s)) throw std::invalid_argument("row_at: the instant is not a number");
  return row_at(log.time_s, time_s);
}

Eigen::Index row_at(const Eigen::VectorXd& time_s, double instant_s) {
  const double* first = time_s.data();
  const double* after = std::upper_bound(first, first + time_s.size(), instant_s);
  return after == first ? 0 : after - first - 1;
}

}  // namespace abbe::sim::compensation
