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

// A batch has as many cases as influence maps compute together.
constexpr std::uint64_t cases_per_batch = machines_per_lot;

// Every analysis has a random stream of its own, so that its cases do not depend on the size of
// another analysis.
constexpr std::uint64_t sobol_stream = 0x5851f42d4c957f2dULL;

Eigen::MatrixXd one_at_a_time_inputs(const Study& study, std::uint64_t from, std::uint64_t to) {
  const Eigen::VectorXd centres = centre(study), deviations = spreads(study);
  Eigen::MatrixXd x(centres.size(), Eigen::Index(to - from));
  for (std::uint64_t k = from; k < to; ++k) {
    const auto input = Eigen::Index(k / 2);
    const Distribution& distribution = study.inputs[std::size_t(input)].distribution;
    const double sign = k % 2 == 0 ? -1.0 : 1.0;
    auto column = x.col(Eigen::Index(k - from));
    column = centres;
    // The step must stay within the limits of a truncated distribution.
    column[input] =
        std::clamp(centres[input] + sign * study.one_at_a_time->step * deviations[input],
                   quantile(distribution, 0.0), quantile(distribution, 1.0));
  }
  return x;
}

Eigen::MatrixXd monte_carlo_inputs(const Study& study, std::uint64_t from, std::uint64_t to) {
  const Sequence sequence{study.monte_carlo->sampling, int(study.inputs.size()), study.seed};
  return draw_inputs(study, points(sequence, from, Eigen::Index(to - from)));
}

Eigen::MatrixXd sobol_inputs(const Study& study, std::uint64_t from, std::uint64_t to) {
  const auto cases_per_point = std::uint64_t(study.inputs.size()) + 2;
  // In Saltelli's design A and B are the halves of a point of one sequence with twice the
  // dimensions. Two sequences would be correlated.
  const Sequence sequence{Sampling::Sobol, 2 * int(study.inputs.size()), study.seed ^ sobol_stream};
  const std::uint64_t first = from / cases_per_point, last = (to - 1) / cases_per_point + 1;
  const Eigen::MatrixXd base = points(sequence, first, Eigen::Index(last - first));
  Eigen::MatrixXd u(Eigen::Index(study.inputs.size()), Eigen::Index(to - from));
  for (std::uint64_t k = from; k < to; ++k)
    u.col(Eigen::Index(k - from)) =
        sobol_column(base.col(Eigen::Index(k / cases_per_point - first)), int(k % cases_per_point));
  return draw_inputs(study, u);
}

Eigen::MatrixXd sweep_inputs(const Study& study, const Sweep& sweep, std::uint64_t from,
                             std::uint64_t to) {
  Eigen::MatrixXd x = centre(study).replicate(1, Eigen::Index(to - from));
  x.row(sweep.input) =
      sweep.values.segment(Eigen::Index(from), Eigen::Index(to - from)).transpose();
  return x;
}

Eigen::MatrixXd case_inputs(const Study& study, const Block& block, std::uint64_t from,
                            std::uint64_t to) {
  switch (block.kind) {
    case Block::Kind::Base:
      return centre(study);
    case Block::Kind::OneAtATime:
      return one_at_a_time_inputs(study, from, to);
    case Block::Kind::MonteCarlo:
    case Block::Kind::Proof:
      return monte_carlo_inputs(study, from, to);
    case Block::Kind::Sobol:
      return sobol_inputs(study, from, to);
    case Block::Kind::Sweep:
      return sweep_inputs(study, study.sweeps[std::size_t(block.sweep)], from, to);
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

Plan make_plan(const Study& study) {
  Plan plan;
  // The order of the blocks sets the numbers of the cases, so it must never depend on results.
  const bool is_full_engine = study.engine == Engine::Full;
  const auto add = [&](Block::Kind kind, std::uint64_t count, int sweep = 0) {
    const bool is_full = is_full_engine || kind == Block::Kind::Proof;
    plan.blocks.push_back({kind, plan.cases, count, sweep, is_full});
    plan.cases += count;
  };
  if (study.inputs.empty()) return plan;
  const auto input_count = std::uint64_t(study.inputs.size());
  add(Block::Kind::Base, 1);
  if (study.one_at_a_time) add(Block::Kind::OneAtATime, 2 * input_count);
  if (study.monte_carlo) add(Block::Kind::MonteCarlo, study.monte_carlo->cases);
  if (study.sobol) add(Block::Kind::Sobol, study.sobol->base_points * (input_count + 2));
  for (std::size_t i = 0; i < study.sweeps.size(); ++i)
    add(Block::Kind::Sweep, std::uint64_t(study.sweeps[i].values.size()), int(i));
  if (study.engine == Engine::Both && study.monte_carlo)
    add(Block::Kind::Proof, std::min(study.verification_cases, study.monte_carlo->cases));
  return plan;
}

const Block& find_block(const Plan& plan, std::uint64_t index) {
  const auto next_block =
      std::upper_bound(plan.blocks.begin(), plan.blocks.end(), index,
                       [](std::uint64_t i, const Block& block) { return i < block.first; });
  return *(next_block - 1);
}

Eigen::MatrixXd case_inputs(const Study& study, const Plan& plan, std::uint64_t first,
                            std::uint64_t last) {
  Eigen::MatrixXd x(Eigen::Index(study.inputs.size()), Eigen::Index(last - first));
  for (std::uint64_t case_number = first; case_number < last;) {
    const Block& block = find_block(plan, case_number);
    const std::uint64_t end = std::min(last, block.first + block.count);
    x.middleCols(Eigen::Index(case_number - first), Eigen::Index(end - case_number)) =
        case_inputs(study, block, case_number - block.first, end - block.first);
    case_number = end;
  }
  return x;
}

Eigen::MatrixXd draw_inputs(const Study& study, const Eigen::MatrixXd& u) {
  std::vector<Distribution> marginals;
  for (const Input& input : study.inputs) marginals.push_back(input.distribution);
  return values(study.copula, marginals, u);
}

std::vector<Batch> make_batches(const Plan& plan) {
  std::vector<Batch> batches;
  for (const Block& block : plan.blocks) {
    const std::uint64_t step = block.full ? 1 : cases_per_batch;
    for (std::uint64_t offset = 0; offset < block.count; offset += step)
      batches.push_back({block.first + offset, block.first + std::min(offset + step, block.count)});
  }
  return batches;
}

namespace {

/// Jobs that cases reuse, so that no case copies a program. There are as many jobs as there are
/// cases running at the same time.
class JobPool {
 public:
  Job take(const PreparedConfiguration& prepared, std::size_t configuration) {
    {
      const std::lock_guard lock(mutex_);
      if (configuration < jobs_.size() && !jobs_[configuration].empty()) {
        Job job = std::move(jobs_[configuration].back());
        jobs_[configuration].pop_back();
        return job;
      }
    }
    return prepared.job;
  }
  void return_job(std::size_t configuration, Job job) {
    const std::lock_guard lock(mutex_);
    if (configuration >= jobs_.size()) jobs_.resize(configuration + 1);
    jobs_[configuration].push_back(std::move(job));
  }

 private:
  std::mutex mutex_;
  std::vector<std::vector<Job>> jobs_;  // (configurations) not in use
};

std::vector<Row> empty_rows(const Study& study, const Batch& batch) {
  const std::size_t columns = study.configurations.size() * study.responses.size();
  std::vector<Row> rows;
  for (std::uint64_t i = batch.first; i < batch.last; ++i)
    rows.push_back({i, std::vector<double>(columns, std::numeric_limits<double>::quiet_NaN()), ""});
  return rows;
}

void enter_responses(const Study& study, std::size_t configuration, const Eigen::VectorXd& values,
                     Row& row) {
  for (std::size_t i = 0; i < study.responses.size(); ++i)
    row.response_values[response_column(study, configuration, i)] = values[Eigen::Index(i)];
}

/// Returns why a map with gouges has no response: the figures would leave out its worst part.
std::string gouge_message(std::size_t gouges, double band) {
  return fmt::format(
      "expected no gouge deeper than the band of {} mm, seen {} {} with such a gouge", band, gouges,
      gouges == 1 ? "vertex" : "vertices");
}

/// Returns the reason why a map has no response; empty if it has one.
std::string missing_response_reason(const cutting::Surface& surface, double band) {
  if (!surface.gouges.empty()) return gouge_message(surface.gouges.size(), band);
  const bool is_cut = std::find(surface.status.begin(), surface.status.end(),
                                cutting::VertexStatus::Cut) != surface.status.end();
  return is_cut ? "" : "nothing of the part was cut";
}

void add_failure(Row& row, const PreparedConfiguration& configuration, const std::string& reason) {
  row.fault += (row.fault.empty() ? "" : "; ") + configuration.arm.name + ": " + reason;
}

/// Cuts every case of the batch in full.
std::vector<Row> cut_batch(const PreparedStudy& prepared, JobPool& pool, const Batch& batch) {
  const Study& study = prepared.study;
  std::vector<Row> rows = empty_rows(study, batch);
  const Eigen::MatrixXd x = case_inputs(study, prepared.plan, batch.first, batch.last);
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t k = 0; k < prepared.configurations.size(); ++k) {
      const PreparedConfiguration& configuration = prepared.configurations[k];
      stop_if_interrupted();
      try {
        CutCase cut_case =
            cut_at(study, configuration, pool.take(configuration, k), x.col(Eigen::Index(i)));
        const double band = cut_case.job.scene.band;
        const std::string reason = missing_response_reason(cut_case.surface, band);
        if (reason.empty())
          enter_responses(study, k, cut_case.responses, rows[i]);
        else
          add_failure(rows[i], configuration, reason);
        pool.return_job(k, std::move(cut_case.job));
      } catch (const BadScene& error) {
        add_failure(rows[i], configuration, error.what());
      } catch (const BadInput& error) {
        add_failure(rows[i], configuration, error.what());
      }
    }
  return rows;
}

/// Estimates every case of the batch from the influence maps. A configuration that gouges with all
/// inputs at their centres has no response, since its map has no passes where it is worst.
std::vector<Row> estimate_batch(const PreparedStudy& prepared, const Batch& batch) {
  stop_if_interrupted();
  const Study& study = prepared.study;
  std::vector<Row> rows = empty_rows(study, batch);
  const Eigen::MatrixXd x = case_inputs(study, prepared.plan, batch.first, batch.last);
  for (std::size_t k = 0; k < prepared.configurations.size(); ++k) {
    const PreparedConfiguration& configuration = prepared.configurations[k];
    const std::size_t gouges = gouge_count(prepared.influences[k]);
    if (gouges > 0) {
      for (Row& row : rows)
        add_failure(row, configuration, gouge_message(gouges, configuration.job.scene.band));
      continue;
    }
    const Eigen::MatrixXd values = responses(study, configuration, prepared.influences[k], x);
    for (std::size_t i = 0; i < rows.size(); ++i)
      enter_responses(study, k, values.col(Eigen::Index(i)), rows[i]);
  }
  return rows;
}

}  // namespace

PreparedStudy prepare_study(const Study& study, const Progress& progress) {
  PreparedStudy prepared{study, make_plan(study), {}, {}};
  if (study.inputs.empty()) return prepared;
  for (const Configuration& configuration : study.configurations)
    prepared.configurations.push_back(prepare_configuration(study, configuration, progress));
  if (study.engine != Engine::Full)
    for (const PreparedConfiguration& prepared_configuration : prepared.configurations)
      prepared.influences.push_back(influence_map(study, prepared_configuration, progress));
  return prepared;
}

ComputeBatch batch_computation(const PreparedStudy& prepared) {
  const auto pool = std::make_shared<JobPool>();
  return [&prepared, pool](const Batch& batch) {
    return find_block(prepared.plan, batch.first).full ? cut_batch(prepared, *pool, batch)
                                                       : estimate_batch(prepared, batch);
  };
}

std::size_t response_column(const Study& study, std::size_t configuration, std::size_t response) {
  return configuration * study.responses.size() + response;
}

}  // namespace abbe::sim::study
