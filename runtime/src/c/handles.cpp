#include "runtime/src/c/handles.h"

#include <limits>
#include <string>

#include "figurine/detail/memory_reserve.h"

namespace figurine::c {
namespace {

constexpr uint32_t kMaxGeneration = std::numeric_limits<uint32_t>::max();

const char* to_string(ObjectKind kind) {
  switch (kind) {
    case ObjectKind::kPackage:
      return "package";
    case ObjectKind::kThreads:
      return "threads";
    case ObjectKind::kRenderer:
      return "renderer";
    case ObjectKind::kAvatar:
      return "avatar";
    case ObjectKind::kSampler:
      return "sampler";
    case ObjectKind::kSampled:
      return "sampled avatar";
  }
  return "unknown object";
}

Status refused(ObjectKind kind, const std::string& why) {
  return Status(StatusCode::kInvalidArgument, std::string(to_string(kind)) + ": " + why);
}

// Zero is no handle, so places count from 1.
uint64_t make_handle(uint32_t index, uint32_t generation) {
  return uint64_t{generation} << 32 | (index + 1);
}

}  // namespace

HandleTable& HandleTable::instance() {
  static HandleTable& table = *new HandleTable;
  return table;
}

Result<uint64_t> HandleTable::add(ObjectKind kind, std::unique_ptr<Object> object) {
  const std::lock_guard lock(mutex_);
  if (free_.empty()) {
    if (slots_.size() >= kMaxGeneration - 1)
      return Status(StatusCode::kLimitExceeded, "handles: no further place");
    const MemoryReserve reserve(4 * (slots_.size() + 1) * (sizeof(Slot) + sizeof(uint32_t)));
    if (!reserve.held()) return no_memory();
    slots_.emplace_back();
    free_.reserve(slots_.capacity());  // so that remove() allocates nothing
    free_.push_back(static_cast<uint32_t>(slots_.size() - 1));
  }
  const uint32_t index = free_.back();
  free_.pop_back();
  Slot& slot = slots_[index];
  slot.object = std::move(object);
  slot.kind = kind;
  return make_handle(index, slot.generation);
}

Status HandleTable::find(ObjectKind kind, uint64_t handle, Slot*& slot) {
  const uint64_t place = handle & 0xffffffff;
  const uint32_t generation = static_cast<uint32_t>(handle >> 32);
  if (handle == 0) return refused(kind, "the handle is zero");
  if (place == 0 || place > slots_.size() || generation == 0 ||
      generation > slots_[place - 1].generation ||
      (generation == slots_[place - 1].generation && slots_[place - 1].object == nullptr)) {
    return refused(kind, "the handle was never given out");
  }
  Slot& found = slots_[place - 1];
  if (generation != found.generation)
    return refused(kind, "a stale handle: what it stood for was removed");
  if (found.kind != kind)
    return refused(kind, std::string("the handle is one of a ") + to_string(found.kind));
  slot = &found;
  return {};
}

Result<HandleTable::AnyPin> HandleTable::pin(ObjectKind kind, uint64_t handle, Use use) {
  const std::lock_guard lock(mutex_);
  Slot* slot = nullptr;
  FIG_RETURN_IF_ERROR(find(kind, handle, slot));
  if (slot->exclusive || (use == Use::kExclusive && slot->pins > 0))
    return refused(kind, "in use by another thread");
  ++slot->pins;
  slot->exclusive = use == Use::kExclusive;
  return AnyPin(static_cast<uint32_t>(slot - slots_.data()), slot->object.get());
}

HandleTable::AnyPin HandleTable::pin_again(uint32_t index) {
  const std::lock_guard lock(mutex_);
  FIG_CHECK(slots_[index].pins > 0 && !slots_[index].exclusive, "pinned, and not exclusively");
  ++slots_[index].pins;
  return AnyPin(index, slots_[index].object.get());
}

void HandleTable::unpin(uint32_t index) {
  const std::lock_guard lock(mutex_);
  --slots_[index].pins;
  slots_[index].exclusive = false;
}

Result<std::unique_ptr<Object>> HandleTable::remove(ObjectKind kind, uint64_t handle) {
  const std::lock_guard lock(mutex_);
  Slot* slot = nullptr;
  FIG_RETURN_IF_ERROR(find(kind, handle, slot));
  if (slot->pins > 0) return refused(kind, "still in use");
  std::unique_ptr<Object> object = std::move(slot->object);
  // A place whose generations are used up stays empty.
  if (slot->generation < kMaxGeneration) {
    ++slot->generation;
    free_.push_back(static_cast<uint32_t>(slot - slots_.data()));
  }
  return object;
}

}  // namespace figurine::c
