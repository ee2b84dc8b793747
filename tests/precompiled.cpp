// Owner of the precompiled headers of the test programs (CMakeLists.txt): a library needs a source.
