#include "toolchain/dataset/pickle.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <map>
#include <vector>

#include "toolchain/error.h"

namespace figurine::dataset {

namespace {

constexpr size_t kMostValues = 1000;  // on the stack; a number needs two dozen
constexpr uint32_t kMostNested = 8;   // tuples; a number needs three
// Bytes and values that are remembered and called back in all: each time twice as many, without it.
constexpr size_t kMostRemembered = 1 << 20;

enum class Kind : uint8_t {
  kOther,   // None, bool, empty dictionaries: what constructors want and the number does not
  kNumber,  // number
  kText,    // text: of str or bytes, one byte a character
  kGlobal,  // text: "module name"
  kTuple,   // items
  kType,    // text: NumPy's type, as "<f8"
  kArray,   // text: its bytes are in items[1] once it is built
  kMark,
};

struct Value {
  Kind kind = Kind::kOther;
  double number = 0;
  std::string text;
  std::vector<Value> items;
  uint32_t nested = 0;  // tuples in it, one in the other
};

size_t weight(const Value& value) {
  size_t sum = 1 + value.text.size();
  for (const Value& item : value.items) sum += weight(item);
  return sum;
}

Value make(Kind kind, std::string text = {}) { return {kind, 0, std::move(text), {}, 0}; }
Value make_number(double number) { return {Kind::kNumber, number, {}, {}, 0}; }

// In one line, whatever it holds.
std::string shown(std::string text) {
  for (char& c : text) c = c >= ' ' && c <= '~' ? c : '?';
  return text.substr(0, 80);
}

class Machine {
 public:
  Machine(std::span<const std::byte> bytes, const std::string& where)
      : bytes_(bytes), where_(where) {}

  double run() {
    for (;;) {
      const uint8_t opcode = byte();
      if (opcode == '.') break;
      step(opcode);
      if (stack_.size() > kMostValues || memo_.size() > kMostValues) fail("is no number");
    }
    const Value value = pop();
    if (value.kind == Kind::kArray) return number_of_array(value);
    if (value.kind != Kind::kNumber) fail("holds something else than one number");
    return value.number;
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const {
    throw InputError(where_ + ": pickle " + reason);
  }

  uint8_t byte() {
    if (at_ >= bytes_.size()) fail("ends early");
    return static_cast<uint8_t>(bytes_[at_++]);
  }
  std::string take(uint64_t size) {
    if (size > bytes_.size() - at_) fail("ends early");
    std::string text(reinterpret_cast<const char*>(bytes_.data()) + at_, size);
    at_ += size;
    return text;
  }
  uint64_t little(int size) {
    uint64_t value = 0;
    for (int i = 0; i < size; ++i) value |= uint64_t{byte()} << (8 * i);
    return value;
  }
  std::string line() {
    std::string text;
    for (uint8_t c; (c = byte()) != '\n';) text += static_cast<char>(c);
    return text;
  }

  void push(Value value) { stack_.push_back(std::move(value)); }
  Value pop() {
    if (stack_.empty()) fail("takes from an empty stack");
    Value value = std::move(stack_.back());
    stack_.pop_back();
    return value;
  }
  Value tuple(size_t count) {
    Value value = make(Kind::kTuple);
    value.items.resize(count);
    while (count-- > 0) {
      value.items[count] = pop();
      value.nested = std::max(value.nested, value.items[count].nested + 1);
    }
    if (value.nested > kMostNested) fail("is no number");
    return value;
  }
  Value tuple_to_mark() {
    size_t count = 0;
    while (count < stack_.size() && stack_[stack_.size() - 1 - count].kind != Kind::kMark) ++count;
    if (count == stack_.size()) fail("has no mark");
    Value value = tuple(count);
    pop();
    return value;
  }
  void put(uint64_t place) {
    if (stack_.empty()) fail("takes from an empty stack");
    remember(stack_.back());
    memo_[place] = stack_.back();
  }
  void get(uint64_t place) {
    const auto found = memo_.find(place);
    if (found == memo_.end()) fail("remembers what it never saw");
    remember(found->second);
    push(found->second);
  }
  void remember(const Value& value) {
    remembered_ += weight(value);
    if (remembered_ > kMostRemembered) fail("is no number");
  }
  double parse(const std::string& text) const {
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (text.empty() || (*end != '\0' && std::string(end) != "L")) fail("holds no number");
    return value;
  }
  // A line of Python's repr of a str: 'f8'.
  static std::string unquoted(const std::string& text) {
    return text.size() >= 2 ? text.substr(1, text.size() - 2) : text;
  }
  uint64_t place(const std::string& text) const {
    const double value = parse(text);
    if (!(value >= 0 && value < 1e6)) fail("remembers too much");
    return static_cast<uint64_t>(value);
  }

  void step(uint8_t opcode) {
    switch (opcode) {
      case 0x80:  // PROTO
        byte();
        break;
      case 0x95:  // FRAME
        take(8);
        break;
      case 'G': {  // BINFLOAT, big-endian
        uint64_t bits = 0;
        for (int i = 0; i < 8; ++i) bits = bits << 8 | byte();
        push(make_number(std::bit_cast<double>(bits)));
        break;
      }
      case 'F':  // FLOAT
      case 'I':  // INT, also bool
      case 'L':  // LONG
        push(make_number(parse(line())));
        break;
      case 'J':  // BININT
        push(make_number(static_cast<int32_t>(little(4))));
        break;
      case 'K':  // BININT1
        push(make_number(static_cast<double>(little(1))));
        break;
      case 'M':  // BININT2
        push(make_number(static_cast<double>(little(2))));
        break;
      case 0x8a: {  // LONG1
        const int size = byte();
        if (size > 8) fail("holds an integer of more than 64 bits");
        const uint64_t value = little(size);
        const bool negative = size > 0 && (value >> (8 * size - 1) & 1) != 0;
        const int unused = 64 - 8 * size;
        push(make_number(negative
                             ? static_cast<double>(static_cast<int64_t>(value << unused) >> unused)
                             : static_cast<double>(value)));
        break;
      }
      case 'N':   // NONE
      case 0x88:  // NEWTRUE
      case 0x89:  // NEWFALSE
      case '}':   // EMPTY_DICT
        push({});
        break;
      default:
        step_text(opcode);
    }
  }

  void step_text(uint8_t opcode) {
    switch (opcode) {
      case 'S':  // STRING
        push(make(Kind::kText, unquoted(line())));
        break;
      case 'V':  // UNICODE
        push(make(Kind::kText, unescaped(line())));
        break;
      case 'U':   // SHORT_BINSTRING
      case 'C':   // SHORT_BINBYTES
      case 0x8c:  // SHORT_BINUNICODE
        push(make(Kind::kText, text_of(opcode == 0x8c, little(1))));
        break;
      case 'T':  // BINSTRING
      case 'B':  // BINBYTES
      case 'X':  // BINUNICODE
        push(make(Kind::kText, text_of(opcode == 'X', little(4))));
        break;
      case 0x96:  // BYTEARRAY8
      case 0x8d:  // BINUNICODE8
      case 0x8e:  // BINBYTES8
        push(make(Kind::kText, text_of(opcode == 0x8d, little(8))));
        break;
      case 'c': {  // GLOBAL
        const std::string module = line();
        push_global(module, line());
        break;
      }
      case 0x93: {  // STACK_GLOBAL
        const Value name = pop(), module = pop();
        push_global(module.text, name.text);
        break;
      }
      default:
        step_structure(opcode);
    }
  }

  void step_structure(uint8_t opcode) {
    switch (opcode) {
      case '(':  // MARK
        push(make(Kind::kMark));
        break;
      case ')':  // EMPTY_TUPLE
        push(make(Kind::kTuple));
        break;
      case 0x85:  // TUPLE1 to TUPLE3
      case 0x86:
      case 0x87:
        push(tuple(opcode - 0x84u));
        break;
      case 't':  // TUPLE
        push(tuple_to_mark());
        break;
      case 0x94:  // MEMOIZE
        put(memo_.size());
        break;
      case 'q':  // BINPUT
        put(byte());
        break;
      case 'r':  // LONG_BINPUT
        put(little(4));
        break;
      case 'p':  // PUT
        put(place(line()));
        break;
      case 'h':  // BINGET
        get(byte());
        break;
      case 'j':  // LONG_BINGET
        get(little(4));
        break;
      case 'g':  // GET
        get(place(line()));
        break;
      case '0':  // POP
        pop();
        break;
      case 'R':  // REDUCE
        reduce();
        break;
      case 'b':  // BUILD
        build();
        break;
      default:
        fail("holds something else than one number (opcode " + std::to_string(opcode) + ")");
    }
  }

  // Of raw-unicode-escape, as protocol 0 writes bytes: \u0000 for those that would break a line.
  std::string unescaped(const std::string& text) const {
    std::string out;
    for (size_t i = 0; i < text.size(); ++i) {
      if (text[i] != '\\' || i + 5 >= text.size() || text[i + 1] != 'u') {
        out += text[i];
        continue;
      }
      char* end = nullptr;
      const std::string digits = text.substr(i + 2, 4);
      const unsigned long point = std::strtoul(digits.c_str(), &end, 16);
      if (*end != '\0' || point > 255) fail("holds a text that is no number's");
      out += static_cast<char>(point);
      i += 5;
    }
    return out;
  }

  // UTF-8 as bytes: protocols 0 to 2 write bytes as text of code points below 256.
  std::string text_of(bool utf8, uint64_t size) {
    const std::string text = take(size);
    if (!utf8) return text;
    std::string out;
    for (size_t i = 0; i < text.size(); ++i) {
      const auto c = static_cast<uint8_t>(text[i]);
      if (c < 0x80) {
        out += text[i];
      } else if ((c == 0xc2 || c == 0xc3) && i + 1 < text.size()) {
        out += static_cast<char>((c & 3) << 6 | (static_cast<uint8_t>(text[++i]) & 0x3f));
      } else {
        fail("holds a text that is no number's");
      }
    }
    return out;
  }

  void push_global(const std::string& module, const std::string& name) {
    static const char* const kKnown[] = {"numpy.core.multiarray scalar",
                                         "numpy._core.multiarray scalar",
                                         "numpy.core.multiarray _reconstruct",
                                         "numpy._core.multiarray _reconstruct",
                                         "numpy.core.numeric _frombuffer",
                                         "numpy._core.numeric _frombuffer",
                                         "numpy dtype",
                                         "numpy ndarray",
                                         "_codecs encode",
                                         "builtins bytearray",
                                         "__builtin__ bytearray"};
    const std::string both = module + " " + name;
    for (const char* known : kKnown) {
      if (both == known) return push(make(Kind::kGlobal, both));
    }
    fail("asks for " + shown(module + "." + name) + ", which is never run");
  }

  void reduce() {
    const Value arguments = pop(), function = pop();
    if (function.kind != Kind::kGlobal || arguments.kind != Kind::kTuple)
      fail("calls what is no function");
    const std::string name = function.text.substr(function.text.find(' ') + 1);
    const std::vector<Value>& items = arguments.items;
    if (name == "dtype" && !items.empty()) return push(make(Kind::kType, items[0].text));
    if (name == "encode" && !items.empty()) return push(make(Kind::kText, items[0].text));
    if (name == "bytearray" && !items.empty()) return push(make(Kind::kText, items[0].text));
    if (name == "scalar" && items.size() == 2 && items[0].kind == Kind::kType)
      return push(make_number(number_of(items[0].text, items[1].text)));
    if (name == "_reconstruct") return push(make(Kind::kArray));
    if (name == "_frombuffer" && items.size() >= 3 && items[1].kind == Kind::kType) {
      Value array = make(Kind::kArray);
      array.items = {items[1], items[0]};
      array.nested = arguments.nested;
      return push(std::move(array));
    }
    fail("calls " + name + " for something else than a number");
  }

  // Of a type: (version, byte order, ...); of an array: (version, shape, type, order, bytes).
  void build() {
    const Value state = pop();
    if (stack_.empty() || state.kind != Kind::kTuple) fail("builds what is no number");
    Value& value = stack_.back();
    if (value.kind == Kind::kType && state.items.size() >= 2) {
      const std::string order = state.items[1].text;
      const size_t letter = value.text.find_first_not_of("<>|=");
      if (letter == std::string::npos) fail("holds no number");
      if (order == "<" || order == ">" || order == "|")
        value.text = order + value.text.substr(letter);
    } else if (value.kind == Kind::kArray && state.items.size() == 5) {
      value.items = {state.items[2], state.items[4]};
      value.nested = state.nested;
    } else {
      fail("builds what is no number");
    }
  }

  double number_of_array(const Value& array) const {
    if (array.items.size() != 2) fail("holds an array without elements");
    return number_of(array.items[0].text, array.items[1].text);
  }

  // type: "<f8", "f4", ">i4": of one element of little-endian bytes unless it says otherwise.
  double number_of(const std::string& type, const std::string& data) const {
    const size_t letter = type.find_first_not_of("<>|=");
    if (letter == std::string::npos || letter + 1 >= type.size()) fail("holds no number");
    const char kind = type[letter];
    const size_t size = static_cast<size_t>(type[letter + 1] - '0');
    if (type.size() != letter + 2 || (size != 1 && size != 2 && size != 4 && size != 8))
      fail("holds a number of type " + shown(type.substr(letter, 8)) + ", which is not read");
    if (data.size() != size) fail("holds an array, not one number");
    uint64_t bits = 0;
    for (size_t i = 0; i < size; ++i) {
      const size_t from = type[0] == '>' ? size - 1 - i : i;
      bits |= uint64_t{static_cast<uint8_t>(data[from])} << (8 * i);
    }
    const int unused = 64 - 8 * static_cast<int>(size);
    if (kind == 'f' && size == 8) return std::bit_cast<double>(bits);
    if (kind == 'f' && size == 4) return std::bit_cast<float>(static_cast<uint32_t>(bits));
    if (kind == 'f' && size == 2) return half(static_cast<uint16_t>(bits));
    if (kind == 'i') return static_cast<double>(static_cast<int64_t>(bits << unused) >> unused);
    if (kind == 'u') return static_cast<double>(bits);
    fail("holds no number");
  }

  static double half(uint16_t bits) {
    const int exponent = bits >> 10 & 31;
    const double fraction = (bits & 1023) / 1024.0, sign = (bits & 0x8000) != 0 ? -1 : 1;
    if (exponent == 31) return fraction == 0 ? sign * HUGE_VAL : std::nan("");
    return sign *
           (exponent == 0 ? std::ldexp(fraction, -14) : std::ldexp(1 + fraction, exponent - 15));
  }

  std::span<const std::byte> bytes_;
  const std::string& where_;
  size_t at_ = 0, remembered_ = 0;
  std::vector<Value> stack_;
  std::map<uint64_t, Value> memo_;
};

}  // namespace

double read_pickled_number(std::span<const std::byte> bytes, const std::string& where) {
  const double value = Machine(bytes, where).run();
  if (!std::isfinite(value)) throw InputError(where + ": is not a finite number");
  return value;
}

}  // namespace figurine::dataset
