#include "sim/study/messages.h"

#include <cstring>
#include <new>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "sim/compensation/plug_in.h"
#include "sim/dialects/bad_program.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/scene/bad_scene.h"
#include "sim/scene/scene.h"

namespace abbe::sim::study {
namespace {

using compensation::PlugInFailure;
using nlohmann::json;

void put(std::string& bytes, const void* data, std::size_t size) {
  if (size > 0) bytes.append(static_cast<const char*>(data), size);
}
void put(std::string& bytes, std::uint64_t number) { put(bytes, &number, sizeof number); }

/// Takes bytes from the front.
struct Reader {
  std::string_view bytes;

  void take(void* data, std::size_t size) {
    if (size > bytes.size()) throw std::runtime_error("a message between ranks is cut off");
    if (size > 0) std::memcpy(data, bytes.data(), size);
    bytes.remove_prefix(size);
  }
  std::uint64_t number() {
    std::uint64_t number = 0;
    take(&number, sizeof number);
    return number;
  }
  /// How many things of a size follow.
  std::size_t count(std::size_t size) {
    const std::uint64_t n = number();
    if (n > bytes.size() / size) throw std::runtime_error("a message between ranks is cut off");
    return n;
  }
  Row row() {
    Row row;
    row.index = number();
    row.answers.resize(count(sizeof(double)));
    take(row.answers.data(), row.answers.size() * sizeof(double));
    row.fault.resize(count(1));
    take(row.fault.data(), row.fault.size());
    return row;
  }
};

json to_json(const BadInput& fault) {
  return {fault.file, fault.line, fault.column, fault.expected, fault.seen};
}
BadInput bad_input_in(const json& fault) {
  return {fault[0], fault[1], fault[2], fault[3], fault[4]};
}

json described(const std::exception_ptr& failure) {
  try {
    std::rethrow_exception(failure);
  } catch (const dialects::BadProgram& program) {
    json faults = json::array();
    for (const BadInput& fault : program.faults) faults.push_back(to_json(fault));
    return {{"kind", "BadScene"}, {"faults", faults}};
  } catch (const BadInput& fault) {
    return {{"kind", "BadInput"}, {"faults", {to_json(fault)}}};
  } catch (const BadScene& scene) {
    json faults = json::array();
    for (const BadInput& fault : scene.faults) faults.push_back(to_json(fault));
    return {{"kind", "BadScene"}, {"faults", faults}};
  } catch (const Interrupted&) {
    return {{"kind", "Interrupted"}};
  } catch (const OutputFailure& fault) {
    return {{"kind", "OutputFailure"}, {"text", fault.what()}};
  } catch (const PlugInFailure& fault) {
    return {{"kind", "PlugInFailure"}, {"text", fault.what()}};
  } catch (const std::bad_alloc&) {
    return {{"kind", "bad_alloc"}};
  } catch (const std::exception& fault) {
    return {{"kind", "other"}, {"text", fault.what()}};
  } catch (...) {
    return {{"kind", "other"}, {"text", "a failure without a text"}};
  }
}

}  // namespace

std::string to_bytes(const Batch& batch) {
  std::string bytes;
  put(bytes, batch.first);
  put(bytes, batch.last);
  return bytes;
}

Batch batch_in(std::string_view bytes) {
  Reader reader{bytes};
  const std::uint64_t first = reader.number();
  return {first, reader.number()};
}

std::string to_bytes(const Finished& finished) {
  std::string bytes = to_bytes(finished.batch);
  put(bytes, finished.rows.size());
  for (const Row& row : finished.rows) {
    put(bytes, row.index);
    put(bytes, row.answers.size());
    put(bytes, row.answers.data(), row.answers.size() * sizeof(double));
    put(bytes, row.fault.size());
    put(bytes, row.fault.data(), row.fault.size());
  }
  return bytes;
}

Finished finished_in(std::string_view bytes) {
  Reader reader{bytes};
  Finished finished;
  finished.batch.first = reader.number();
  finished.batch.last = reader.number();
  finished.rows.resize(reader.count(3 * sizeof(std::uint64_t)));
  for (Row& row : finished.rows) row = reader.row();
  return finished;
}

std::string to_bytes(const std::exception_ptr& failure) {
  if (!failure) return {};
  return described(failure).dump(-1, ' ', false, json::error_handler_t::replace);
}

std::exception_ptr failure_in(const std::string& bytes) {
  if (bytes.empty()) return nullptr;
  const json failure = json::parse(bytes);
  const std::string kind = failure["kind"];
  const std::string text = failure.value("text", "");
  if (kind == "BadInput") return std::make_exception_ptr(bad_input_in(failure["faults"][0]));
  if (kind == "BadScene") {
    std::vector<BadInput> faults;
    for (const json& fault : failure["faults"]) faults.push_back(bad_input_in(fault));
    return std::make_exception_ptr(BadScene(faults));
  }
  if (kind == "Interrupted") return std::make_exception_ptr(Interrupted());
  if (kind == "OutputFailure") return std::make_exception_ptr(OutputFailure(text));
  if (kind == "PlugInFailure") return std::make_exception_ptr(PlugInFailure(text));
  if (kind == "bad_alloc") return std::make_exception_ptr(std::bad_alloc());
  return std::make_exception_ptr(std::runtime_error(text));
}

}  // namespace abbe::sim::study
