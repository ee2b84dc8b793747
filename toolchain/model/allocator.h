// Keeps freed memory in the process, for programs that allocate the same large tensors in every
// iteration.
#pragma once

namespace figurine::model {

// glibc hands large blocks back to the system when they are freed and gets them again, page by
// page, when they are allocated: that took a sixth of a training iteration. Call once at the start
// of a training process. Does nothing where the C library is another.
void keep_freed_memory();

}  // namespace figurine::model
