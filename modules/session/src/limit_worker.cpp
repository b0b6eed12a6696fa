#include "limit_worker.hpp"

#include <exception>
#include <utility>

namespace palpate::session {

LimitWorker::~LimitWorker() {
  cancel();
  if (thread_.joinable()) thread_.join();
}

void LimitWorker::start(Work work, Done done) {
  if (thread_.joinable()) thread_.join();
  cancel_ = core::CancelToken();
  busy_ = true;
  thread_ = std::thread([this, work = std::move(work), done = std::move(done), cancel = cancel_] {
    std::optional<simulation::StableStep> found;
    try {
      found = work(core::Progress({}, cancel));
    } catch (const std::exception&) {
      // Cancelled, or out of memory: the bound is kept, which is safe.
    }
    if (cancel.cancelled()) found.reset();
    busy_ = false;
    done(found);
  });
}

void LimitWorker::cancel() { cancel_.cancel(); }

}  // namespace palpate::session
