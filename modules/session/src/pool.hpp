#pragma once

#include <memory>
#include <mutex>
#include <vector>

namespace palpate::session {

/// Lends objects that are handed on as shared values and takes them back when
/// the last holder lets go, on whichever thread that is. So no frame's memory
/// is written again while somebody still reads it (docs/adr/0006). The pool
/// may end before what it lent.
template <typename T>
class Pool {
 public:
  explicit Pool(std::size_t most_kept = 4) : shelf_(std::make_shared<Shelf>()) {
    shelf_->most_kept = most_kept;
  }

  template <typename Make>
  std::shared_ptr<T> take(Make make) {
    std::unique_ptr<T> object;
    {
      const std::lock_guard<std::mutex> lock(shelf_->mutex);
      if (!shelf_->free.empty()) {
        object = std::move(shelf_->free.back());
        shelf_->free.pop_back();
      }
    }
    if (!object) object = make();
    return std::shared_ptr<T>(object.release(), [shelf = shelf_](T* returned) {
      std::unique_ptr<T> owned(returned);
      const std::lock_guard<std::mutex> lock(shelf->mutex);
      if (shelf->free.size() < shelf->most_kept) shelf->free.push_back(std::move(owned));
    });
  }

 private:
  struct Shelf {
    std::mutex mutex;
    std::size_t most_kept = 4;
    std::vector<std::unique_ptr<T>> free;
  };
  std::shared_ptr<Shelf> shelf_;
};

}  // namespace palpate::session
