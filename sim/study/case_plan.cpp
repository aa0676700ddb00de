#include "sim/study/case_plan.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "sim/files/progress.h"
#include "sim/scene/toml.h"
#include "sim/study/influence.h"
#include "sim/study/response_statistics.h"

namespace abbe::sim::study {

namespace {

// A batch fills exactly one lot of the influence maps.
constexpr std::uint64_t cases_of_a_batch = machines_at_once;

// Every analysis draws from a stream of its own, so that its cases do not depend on the size of
// another analysis.
constexpr std::uint64_t sobol_stream = 0x5851f42d4c957f2dULL;

Eigen::MatrixXd one_at_a_time(const Study& study, std::uint64_t from, std::uint64_t to) {
  const Eigen::VectorXd x0 = centre(study), sd = spreads(study);
  Eigen::MatrixXd x(x0.size(), Eigen::Index(to - from));
  for (std::uint64_t k = from; k < to; ++k) {
    const auto input = Eigen::Index(k / 2);
    const Distribution& d = study.inputs[std::size_t(input)].distribution;
    const double side = k % 2 == 0 ? -1.0 : 1.0;
    auto column = x.col(Eigen::Index(k - from));
    column = x0;
    // A step of a truncated distribution must not leave its limits.
    column[input] = std::clamp(x0[input] + side * study.one_at_a_time->step * sd[input],
                               quantile(d, 0.0), quantile(d, 1.0));
  }
  return x;
}

Eigen::MatrixXd monte_carlo(const Study& study, std::uint64_t from, std::uint64_t to) {
  const Sequence sequence{study.monte_carlo->sampling, int(study.inputs.size()), study.seed};
  return drawn(study, points(sequence, from, Eigen::Index(to - from)));
}

Eigen::MatrixXd sobol(const Study& study, std::uint64_t from, std::uint64_t to) {
  const auto columns = std::uint64_t(study.inputs.size()) + 2;
  // A and B are the halves of one point of a sequence with twice the dimensions, as Saltelli's
  // design requires: two separate sequences would be correlated.
  const Sequence sequence{Sampling::Sobol, 2 * int(study.inputs.size()), study.seed ^ sobol_stream};
  const std::uint64_t first = from / columns, last = (to - 1) / columns + 1;
  const Eigen::MatrixXd base = points(sequence, first, Eigen::Index(last - first));
  Eigen::MatrixXd u(Eigen::Index(study.inputs.size()), Eigen::Index(to - from));
  for (std::uint64_t k = from; k < to; ++k)
    u.col(Eigen::Index(k - from)) =
        sobol_column(base.col(Eigen::Index(k / columns - first)), int(k % columns));
  return drawn(study, u);
}

Eigen::MatrixXd swept(const Study& study, const Sweep& sweep, std::uint64_t from,
                      std::uint64_t to) {
  Eigen::MatrixXd x = centre(study).replicate(1, Eigen::Index(to - from));
  x.row(sweep.input) =
      sweep.values.segment(Eigen::Index(from), Eigen::Index(to - from)).transpose();
  return x;
}

Eigen::MatrixXd inputs_of(const Study& study, const Block& block, std::uint64_t from,
                          std::uint64_t to) {
  switch (block.kind) {
    case Block::Kind::Base:
      return centre(study);
    case Block::Kind::OneAtATime:
      return one_at_a_time(study, from, to);
    case Block::Kind::MonteCarlo:
    case Block::Kind::Proof:
      return monte_carlo(study, from, to);
    case Block::Kind::Sobol:
      return sobol(study, from, to);
    case Block::Kind::Sweep:
      return swept(study, study.sweeps[std::size_t(block.sweep)], from, to);
  }
  return {};
}

}  // namespace

const char* name_of(Block::Kind kind) {
  switch (kind) {
    case Block::Kind::Base:
      return "base";
    case Block::Kind::OneAtATime:
      return "one_at_a_time";
    case Block::Kind::MonteCarlo:
      return "monte_carlo";
    case Block::Kind::Sobol:
      return "sobol_indices";
    case Block::Kind::Sweep:
      return "sweep";
    case Block::Kind::Proof:
      return "proof";
  }
  return "";
}

Plan plan_of(const Study& study) {
  Plan plan;
  // The order of the blocks defines the numbers of the cases, so it must never depend on results.
  const bool full = study.engine == Engine::Full;
  const auto add = [&](Block::Kind kind, std::uint64_t count, int sweep = 0) {
    const bool cut = full || kind == Block::Kind::Proof;
    plan.blocks.push_back({kind, plan.cases, count, sweep, cut});
    plan.cases += count;
  };
  if (study.inputs.empty()) return plan;
  const auto p = std::uint64_t(study.inputs.size());
  add(Block::Kind::Base, 1);
  if (study.one_at_a_time) add(Block::Kind::OneAtATime, 2 * p);
  if (study.monte_carlo) add(Block::Kind::MonteCarlo, study.monte_carlo->cases);
  if (study.sobol) add(Block::Kind::Sobol, study.sobol->base_points * (p + 2));
  for (std::size_t i = 0; i < study.sweeps.size(); ++i)
    add(Block::Kind::Sweep, std::uint64_t(study.sweeps[i].values.size()), int(i));
  if (study.engine == Engine::Both && study.monte_carlo)
    add(Block::Kind::Proof, std::min(study.proofs, study.monte_carlo->cases));
  return plan;
}

const Block& block_of(const Plan& plan, std::uint64_t index) {
  const auto after =
      std::upper_bound(plan.blocks.begin(), plan.blocks.end(), index,
                       [](std::uint64_t i, const Block& block) { return i < block.first; });
  return *(after - 1);
}

Eigen::MatrixXd inputs_of(const Study& study, const Plan& plan, std::uint64_t first,
                          std::uint64_t last) {
  Eigen::MatrixXd x(Eigen::Index(study.inputs.size()), Eigen::Index(last - first));
  for (std::uint64_t at = first; at < last;) {
    const Block& block = block_of(plan, at);
    const std::uint64_t end = std::min(last, block.first + block.count);
    x.middleCols(Eigen::Index(at - first), Eigen::Index(end - at)) =
        inputs_of(study, block, at - block.first, end - block.first);
    at = end;
  }
  return x;
}

Eigen::MatrixXd drawn(const Study& study, const Eigen::MatrixXd& u) {
  std::vector<Distribution> marginals;
  for (const Input& input : study.inputs) marginals.push_back(input.distribution);
  return values(study.copula, marginals, u);
}

std::vector<Batch> batches_of(const Plan& plan) {
  std::vector<Batch> batches;
  for (const Block& block : plan.blocks) {
    const std::uint64_t step = block.full ? 1 : cases_of_a_batch;
    for (std::uint64_t at = 0; at < block.count; at += step)
      batches.push_back({block.first + at, block.first + std::min(at + step, block.count)});
  }
  return batches;
}

namespace {

/// Jobs that cases pass on to each other, so that no case copies a program; as many exist as cases
/// run at the same time.
class SpareJobs {
 public:
  Job take(const PreparedConfiguration& ready, std::size_t arm) {
    {
      const std::lock_guard lock(mutex_);
      if (arm < spare_.size() && !spare_[arm].empty()) {
        Job job = std::move(spare_[arm].back());
        spare_[arm].pop_back();
        return job;
      }
    }
    return ready.job;
  }
  void return_job(std::size_t arm, Job job) {
    const std::lock_guard lock(mutex_);
    if (arm >= spare_.size()) spare_.resize(arm + 1);
    spare_[arm].push_back(std::move(job));
  }

 private:
  std::mutex mutex_;
  std::vector<std::vector<Job>> spare_;
};

std::vector<Row> empty_rows(const PreparedStudy& ready, const Batch& batch) {
  const std::size_t columns = ready.study.arms.size() * ready.study.responses.size();
  std::vector<Row> rows;
  for (std::uint64_t i = batch.first; i < batch.last; ++i)
    rows.push_back({i, std::vector<double>(columns, std::numeric_limits<double>::quiet_NaN()), ""});
  return rows;
}

void put(const PreparedStudy& ready, std::size_t arm, const Eigen::VectorXd& values, Row& row) {
  for (std::size_t i = 0; i < ready.study.responses.size(); ++i)
    row.answers[response_column(ready.study, arm, i)] = values[Eigen::Index(i)];
}

/// Returns the reason why a map with gouges has no response: its figures would leave out the worst
/// part.
std::string gouge_message(std::size_t gouges, double band) {
  return fmt::format("expected no gouge deeper than the band of {} mm, seen {} {} with one", band,
                     gouges, gouges == 1 ? "vertex" : "vertices");
}

/// Returns the reason why a map has no response; empty if it has one.
std::string missing_response_reason(const cutting::Surface& surface, double band) {
  if (!surface.gouges.empty()) return gouge_message(surface.gouges.size(), band);
  const bool cut = std::find(surface.status.begin(), surface.status.end(),
                             cutting::VertexStatus::Cut) != surface.status.end();
  return cut ? "" : "nothing of the part was cut";
}

void note(Row& row, const PreparedStudy& ready, std::size_t arm, const std::string& fault) {
  row.fault += (row.fault.empty() ? "" : "; ") + ready.arms[arm].arm.name + ": " + fault;
}

/// Cuts every case of the batch in full.
std::vector<Row> cut(const PreparedStudy& ready, SpareJobs& spare, const Batch& batch) {
  std::vector<Row> rows = empty_rows(ready, batch);
  const Eigen::MatrixXd x = inputs_of(ready.study, ready.plan, batch.first, batch.last);
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t arm = 0; arm < ready.arms.size(); ++arm) {
      stop_if_interrupted();
      try {
        Tried tried = cut_at(ready.study, ready.arms[arm], spare.take(ready.arms[arm], arm),
                             x.col(Eigen::Index(i)));
        const std::string fault = missing_response_reason(tried.surface, tried.job.scene.band);
        if (fault.empty())
          put(ready, arm, tried.responses, rows[i]);
        else
          note(rows[i], ready, arm, fault);
        spare.return_job(arm, std::move(tried.job));
      } catch (const BadScene& bad) {
        note(rows[i], ready, arm, bad.what());
      } catch (const BadInput& bad) {
        note(rows[i], ready, arm, bad.what());
      }
    }
  return rows;
}

/// Estimates every case of the batch from the influence maps. A configuration that gouges with
/// every input at its centre has no response: its map has no passes where it is worst.
std::vector<Row> estimated(const PreparedStudy& ready, const Batch& batch) {
  stop_if_interrupted();
  std::vector<Row> rows = empty_rows(ready, batch);
  const Eigen::MatrixXd x = inputs_of(ready.study, ready.plan, batch.first, batch.last);
  for (std::size_t arm = 0; arm < ready.arms.size(); ++arm) {
    const std::size_t gouges = gouges_of(ready.influences[arm]);
    if (gouges > 0) {
      for (Row& row : rows)
        note(row, ready, arm, gouge_message(gouges, ready.arms[arm].job.scene.band));
      continue;
    }
    const Eigen::MatrixXd values =
        responses(ready.study, ready.arms[arm], ready.influences[arm], x);
    for (std::size_t i = 0; i < rows.size(); ++i)
      put(ready, arm, values.col(Eigen::Index(i)), rows[i]);
  }
  return rows;
}

}  // namespace

PreparedStudy prepare_study(const Study& study, const Progress& progress) {
  PreparedStudy ready{study, plan_of(study), {}, {}};
  if (study.inputs.empty()) return ready;
  for (const Configuration& arm : study.arms)
    ready.arms.push_back(prepare_configuration(study, arm, progress));
  if (study.engine != Engine::Full)
    for (const PreparedConfiguration& arm : ready.arms)
      ready.influences.push_back(influence_map(study, arm, progress));
  return ready;
}

ComputeBatch batch_computation(const PreparedStudy& ready) {
  const auto spare = std::make_shared<SpareJobs>();
  return [&ready, spare](const Batch& batch) {
    return block_of(ready.plan, batch.first).full ? cut(ready, *spare, batch)
                                                  : estimated(ready, batch);
  };
}

std::size_t response_column(const Study& study, std::size_t arm, std::size_t response) {
  return arm * study.responses.size() + response;
}

}  // namespace abbe::sim::study
