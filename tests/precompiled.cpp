// Owner of the precompiled header of the test programs (CMakeLists.txt): a library needs a source.
