#include "sim/study/engine.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "sim/files/progress.h"
#include "sim/scene/bad_scene.h"

namespace abbe::sim::study {
namespace {

/// Jobs that tries hand on to each other, so that a case does not copy a program: as many as run at
/// once.
class SpareJobs {
 public:
  Job take(const ReadyArm& ready, std::size_t arm) {
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
  void give_back(std::size_t arm, Job job) {
    const std::lock_guard lock(mutex_);
    if (arm >= spare_.size()) spare_.resize(arm + 1);
    spare_[arm].push_back(std::move(job));
  }

 private:
  std::mutex mutex_;
  std::vector<std::vector<Job>> spare_;
};

std::vector<Row> empty_rows(const ReadyStudy& ready, const Batch& batch) {
  const std::size_t columns = ready.study.arms.size() * ready.study.responses.size();
  std::vector<Row> rows;
  for (std::uint64_t i = batch.first; i < batch.last; ++i)
    rows.push_back({i, std::vector<double>(columns, std::numeric_limits<double>::quiet_NaN()), ""});
  return rows;
}

void put(const ReadyStudy& ready, std::size_t arm, const Eigen::VectorXd& values, Row& row) {
  for (std::size_t i = 0; i < ready.study.responses.size(); ++i)
    row.answers[column_of(ready.study, arm, i)] = values[Eigen::Index(i)];
}

/// Why a map with so many gouges has no answer: its figures would leave out what is worst on it.
std::string fault_of_gouges(std::size_t gouges, double band) {
  return fmt::format("expected no gouge deeper than the band of {} mm, seen {} {} with one", band,
                     gouges, gouges == 1 ? "vertex" : "vertices");
}

/// Why a map has no answer. Empty if it has one.
std::string fault_of(const cutting::Surface& surface, double band) {
  if (!surface.gouges.empty()) return fault_of_gouges(surface.gouges.size(), band);
  const bool cut = std::find(surface.status.begin(), surface.status.end(),
                             cutting::VertexStatus::Cut) != surface.status.end();
  return cut ? "" : "nothing of the part was cut";
}

void note(Row& row, const ReadyStudy& ready, std::size_t arm, const std::string& fault) {
  row.fault += (row.fault.empty() ? "" : "; ") + ready.arms[arm].arm.name + ": " + fault;
}

/// Every case of the batch cut.
std::vector<Row> cut(const ReadyStudy& ready, SpareJobs& spare, const Batch& batch) {
  std::vector<Row> rows = empty_rows(ready, batch);
  const Eigen::MatrixXd x = inputs_of(ready.study, ready.plan, batch.first, batch.last);
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t arm = 0; arm < ready.arms.size(); ++arm) {
      stop_if_interrupted();
      try {
        Tried tried = cut_at(ready.study, ready.arms[arm], spare.take(ready.arms[arm], arm),
                             x.col(Eigen::Index(i)));
        const std::string fault = fault_of(tried.surface, tried.job.scene.band);
        if (fault.empty())
          put(ready, arm, tried.responses, rows[i]);
        else
          note(rows[i], ready, arm, fault);
        spare.give_back(arm, std::move(tried.job));
      } catch (const BadScene& bad) {
        note(rows[i], ready, arm, bad.what());
      } catch (const BadInput& bad) {
        note(rows[i], ready, arm, bad.what());
      }
    }
  return rows;
}

/// Every case of the batch from the influence maps. An arm that gouges with every input at its
/// centre has no answer: its map has no rivals where it is worst.
std::vector<Row> estimated(const ReadyStudy& ready, const Batch& batch) {
  stop_if_interrupted();
  std::vector<Row> rows = empty_rows(ready, batch);
  const Eigen::MatrixXd x = inputs_of(ready.study, ready.plan, batch.first, batch.last);
  for (std::size_t arm = 0; arm < ready.arms.size(); ++arm) {
    const std::size_t gouges = gouges_of(ready.influences[arm]);
    if (gouges > 0) {
      for (Row& row : rows)
        note(row, ready, arm, fault_of_gouges(gouges, ready.arms[arm].job.scene.band));
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

ReadyStudy ready_study(const Study& study, const Progress& progress) {
  ReadyStudy ready{study, plan_of(study), {}, {}};
  if (study.inputs.empty()) return ready;
  for (const Arm& arm : study.arms) ready.arms.push_back(ready_arm(study, arm, progress));
  if (study.engine != Engine::Full)
    for (const ReadyArm& arm : ready.arms)
      ready.influences.push_back(influence_map(study, arm, progress));
  return ready;
}

Compute compute_of(const ReadyStudy& ready) {
  const auto spare = std::make_shared<SpareJobs>();
  return [&ready, spare](const Batch& batch) {
    return block_of(ready.plan, batch.first).full ? cut(ready, *spare, batch)
                                                  : estimated(ready, batch);
  };
}

std::size_t column_of(const Study& study, std::size_t arm, std::size_t response) {
  return arm * study.responses.size() + response;
}

}  // namespace abbe::sim::study
