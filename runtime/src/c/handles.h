// The table behind the handles of figurine.h. A handle is a place in it and a generation; a place
// that is used again has another generation, so a handle of what was removed finds nothing.
//
// Whoever uses a thing pins it, for a call or for as long as it borrows from it. What is pinned
// cannot be removed; what one thread at a time may use is pinned exclusively. All functions may be
// called by any thread.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "figurine/status.h"

namespace figurine::c {

enum class ObjectKind : uint8_t { kPackage, kThreads, kRenderer, kAvatar, kSampler, kSampled };

// What a handle stands for; each type has a static kKind.
class Object {
 public:
  virtual ~Object() = default;
};

class HandleTable {
 public:
  // The one of the program. It is never destroyed: what is left at exit may have threads.
  static HandleTable& instance();

  class AnyPin {
   public:
    AnyPin() = default;
    AnyPin(AnyPin&& other) noexcept
        : index_(other.index_), object_(std::exchange(other.object_, nullptr)) {}
    AnyPin& operator=(AnyPin&& other) noexcept {
      std::swap(index_, other.index_);
      std::swap(object_, other.object_);
      return *this;
    }
    ~AnyPin() {
      if (object_ != nullptr) instance().unpin(index_);
    }

   protected:
    friend class HandleTable;
    AnyPin(uint32_t index, Object* object) : index_(index), object_(object) {}
    uint32_t index_ = 0;
    Object* object_ = nullptr;
  };

  template <class T>
  class Pin : public AnyPin {
   public:
    Pin() = default;
    explicit Pin(AnyPin&& pin) : AnyPin(std::move(pin)) {}
    T* operator->() const { return static_cast<T*>(object_); }
    T& operator*() const { return *static_cast<T*>(object_); }
    // A further one of a thing that is pinned by more than one.
    Pin share() const { return Pin(instance().pin_again(index_)); }
  };

  enum class Use : uint8_t { kShared, kExclusive };

  // The new thing's handle. kLimitExceeded, kOutOfMemory.
  template <class T>
  Result<uint64_t> add(std::unique_ptr<T> object) {
    return add(T::kKind, std::move(object));
  }
  // kInvalidArgument for a handle that is none of this kind or no more, and for a thing that is
  // pinned otherwise if the use is exclusive.
  template <class T>
  Result<Pin<T>> pin(uint64_t handle, Use use = Use::kShared) {
    Result<AnyPin> pinned = pin(T::kKind, handle, use);
    if (!pinned.ok()) return pinned.status();
    return Pin<T>(std::move(pinned).value());
  }
  // Takes the thing out of the table, for the caller to destroy. kInvalidArgument as of pin(), and
  // while it is pinned.
  template <class T>
  Result<std::unique_ptr<T>> remove(uint64_t handle) {
    Result<std::unique_ptr<Object>> object = remove(T::kKind, handle);
    if (!object.ok()) return object.status();
    return std::unique_ptr<T>(static_cast<T*>(object->release()));
  }
  // Reads a thing while nobody can remove it: read(const T&) is short and calls nothing of this.
  template <class T, class Read>
  Status look(uint64_t handle, const Read& read) {
    const std::lock_guard lock(mutex_);
    Slot* slot = nullptr;
    FIG_RETURN_IF_ERROR(find(T::kKind, handle, slot));
    read(static_cast<const T&>(*slot->object));
    return {};
  }

 private:
  struct Slot {
    std::unique_ptr<Object> object;  // null: free
    ObjectKind kind{};
    uint32_t generation = 1;  // of the object, or of the next one
    uint32_t pins = 0;
    bool exclusive = false;
  };

  Result<uint64_t> add(ObjectKind kind, std::unique_ptr<Object> object);
  Result<AnyPin> pin(ObjectKind kind, uint64_t handle, Use use);
  AnyPin pin_again(uint32_t index);
  void unpin(uint32_t index);
  Result<std::unique_ptr<Object>> remove(ObjectKind kind, uint64_t handle);
  Status find(ObjectKind kind, uint64_t handle, Slot*& slot);

  std::mutex mutex_;
  std::vector<Slot> slots_;
  std::vector<uint32_t> free_;
};

template <class T>
using Pin = HandleTable::Pin<T>;
using Use = HandleTable::Use;

inline HandleTable& handles() { return HandleTable::instance(); }

}  // namespace figurine::c
