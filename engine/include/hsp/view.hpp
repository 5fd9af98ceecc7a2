// Views: the arguments of calls. An argument's type determines its entries, its shape and its use.
//
//   In<'m', 'n'> J;     reads a matrix             Ints<'m'> rows;       reads integers
//   Out<'n'> a;         writes a vector            Flags<'m'> springs;   reads booleans
//   InOut<'n'> g;       reads and writes it        In<'k', 3, 3> turns;  reads k matrices
//
// A size is a number, or a letter that stands for one number in all arguments of a call. Sizes
// that are numbers are known to Eigen. Matrices lie row by row, as NumPy's; those of Pinocchio
// lie column by column, and are Columns<...>.
#pragma once
#include <Eigen/Dense>
#include <cstdint>
#include <type_traits>

namespace hsp {

using Eigen::Index;
using Vector3 = Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix3 = Eigen::Matrix3d;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

enum class Access : std::int32_t { In, Out, InOut, Number, Object };
enum class Order : std::int32_t { Rows, Columns };

// Letters begin at 'A'; smaller values are the size itself.
constexpr bool is_letter(int size) { return size >= 'A'; }
constexpr bool is_size(int size) {
  return (0 < size && size < 'A') || ('A' <= size && size <= 'Z') || ('a' <= size && size <= 'z');
}
constexpr int eigen_size(int size) { return is_letter(size) ? Eigen::Dynamic : size; }

namespace detail {

template <class Scalar, Order order, int... sizes> struct Plain;
template <class Scalar, Order order, int rows> struct Plain<Scalar, order, rows> {
  using type = Eigen::Matrix<Scalar, eigen_size(rows), 1>;
};
template <class Scalar, Order order, int rows, int columns>
struct Plain<Scalar, order, rows, columns> {
  static constexpr int storage =
      order == Order::Rows && columns != 1 ? Eigen::RowMajor : Eigen::ColMajor;
  using type = Eigen::Matrix<Scalar, eigen_size(rows), eigen_size(columns), storage>;
};

template <class Entry, int... sizes> constexpr bool is_declared() {
  static_assert((is_size(sizes) && ...), "a size is a number from 1 to 64, or a letter");
  static_assert(std::is_same_v<Entry, double> || std::is_same_v<Entry, std::int64_t> ||
                    std::is_same_v<Entry, bool>,
                "entries are double, std::int64_t or bool");
  return true;
}

template <Access access, class T>
using Const = std::conditional_t<access == Access::In, const T, T>;

}  // namespace detail

// A vector or a matrix in memory that belongs to NumPy.
template <class Entry, Access use, Order order_, int... sizes>
struct View
    : Eigen::Map<detail::Const<use, typename detail::Plain<Entry, order_, sizes...>::type>> {
  using Plain = typename detail::Plain<Entry, order_, sizes...>::type;
  using Base = Eigen::Map<detail::Const<use, Plain>>;
  using Scalar = Entry;
  static constexpr Access access = use;
  static constexpr Order order = order_;
  static constexpr std::int32_t rank = sizeof...(sizes);
  static constexpr std::int32_t shape[3] = {sizes...};
  static_assert(detail::is_declared<Entry, sizes...>());

  View() : Base(nullptr, least(Plain::RowsAtCompileTime), least(Plain::ColsAtCompileTime)) {}
  View(const View&) = default;
  View& operator=(const View& other) {
    Base::operator=(other);
    return *this;
  }
  using Base::operator=;

  static void bind(void* member, void* data, const std::int64_t* given) {
    Base* map = static_cast<View*>(member);
    new (map) Base(static_cast<Entry*>(data), given[0], rank == 2 ? given[1] : 1);
  }

 private:
  static constexpr int least(int size) { return size == Eigen::Dynamic ? 0 : size; }
};

// Matrices of one shape, one after the other: stack[k] is the k-th.
template <class Entry, Access use, int count, int rows, int columns>
struct View<Entry, use, Order::Rows, count, rows, columns> {
  using Plain = typename detail::Plain<Entry, Order::Rows, rows, columns>::type;
  using Map = Eigen::Map<detail::Const<use, Plain>>;
  using Scalar = Entry;
  static constexpr Access access = use;
  static constexpr Order order = Order::Rows;
  static constexpr std::int32_t rank = 3;
  static constexpr std::int32_t shape[3] = {count, rows, columns};
  static_assert(detail::is_declared<Entry, count, rows, columns>());

  Index size() const { return size_; }
  Map operator[](Index k) const { return Map(data_ + k * rows_ * columns_, rows_, columns_); }

  static void bind(void* member, void* data, const std::int64_t* given) {
    View* view = static_cast<View*>(member);
    view->data_ = static_cast<Entry*>(data);
    view->size_ = given[0];
    view->rows_ = given[1];
    view->columns_ = given[2];
  }

 private:
  Entry* data_ = nullptr;
  Index size_ = 0, rows_ = 0, columns_ = 0;
};

template <int... sizes> using In = View<double, Access::In, Order::Rows, sizes...>;
template <int... sizes> using Out = View<double, Access::Out, Order::Rows, sizes...>;
template <int... sizes> using InOut = View<double, Access::InOut, Order::Rows, sizes...>;
template <int... sizes> using Ints = View<std::int64_t, Access::In, Order::Rows, sizes...>;
template <int... sizes> using OutInts = View<std::int64_t, Access::Out, Order::Rows, sizes...>;
template <int... sizes> using InOutInts = View<std::int64_t, Access::InOut, Order::Rows, sizes...>;
template <int... sizes> using Flags = View<bool, Access::In, Order::Rows, sizes...>;
template <int... sizes> using Columns = View<double, Access::In, Order::Columns, sizes...>;
template <int... sizes> using OutColumns = View<double, Access::Out, Order::Columns, sizes...>;

// An object that calls share, such as a plan.
template <class T> struct Shared {
  using Type = T;
  T* object = nullptr;
  T* operator->() const { return object; }
};

// The sizes denoted by the letters of a call.
class Sizes {
 public:
  std::int64_t& operator[](int letter) { return of_[letter - 'A']; }
  Index operator()(int size) const { return is_letter(size) ? of_[size - 'A'] : size; }

 private:
  std::int64_t of_['z' - 'A' + 1] = {};
};

// Scratch memory of a call, not an argument: the call allocates it once.
template <int... sizes> struct Scratch : detail::Plain<double, Order::Rows, sizes...>::type {
  using Base = typename detail::Plain<double, Order::Rows, sizes...>::type;
  using Base::operator=;
  void prepare(const Sizes& size) {
    constexpr int shape[2] = {sizes...};
    Base::setZero(size(shape[0]), sizeof...(sizes) == 2 ? size(shape[1]) : 1);
  }
};

}  // namespace hsp
