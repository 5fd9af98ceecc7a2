// TSID's step without Python: the objects that Python made, run from C++.
//
// The references of all tasks are captured before; a step sets them, computes the
// problem, solves it and reads the efforts.

#include <boost/python.hpp>
#include <chrono>
#include <vector>

#include <tsid/formulations/inverse-dynamics-formulation-acc-force.hpp>
#include <tsid/solvers/solver-HQP-eiquadprog-fast.hpp>
#include <tsid/tasks/task-com-equality.hpp>
#include <tsid/tasks/task-joint-posture.hpp>
#include <tsid/tasks/task-se3-equality.hpp>

namespace py = boost::python;
using tsid::trajectories::TrajectorySample;

struct Referenced {
  virtual ~Referenced() = default;
  virtual void capture() = 0;
  virtual void set(std::size_t i) = 0;
};

template <class Task>
struct Captured : Referenced {
  Task& task;
  std::vector<TrajectorySample> samples;
  explicit Captured(Task& t) : task(t) {}
  void capture() override { samples.push_back(task.getReference()); }
  void set(std::size_t i) override { task.setReference(samples[i]); }
};

struct Steps {
  using Problem = tsid::InverseDynamicsFormulationAccForce;
  using Solver = tsid::solvers::SolverHQuadProgFast;
  Problem& problem;
  Solver& solver;
  std::vector<std::unique_ptr<Referenced>> tasks;
  std::vector<double> times;
  std::vector<Eigen::VectorXd> qs, vs;
  Eigen::VectorXd tau;
  py::object kept;

  Steps(py::object p, py::object s, py::list given)
      : problem(py::extract<Problem&>(p)), solver(py::extract<Solver&>(s)),
        kept(py::make_tuple(p, s, given)) {
    using namespace tsid::tasks;
    for (int k = 0; k < py::len(given); ++k) {
      py::object each = given[k];
      if (py::extract<TaskSE3Equality&> se3(each); se3.check())
        tasks.push_back(std::make_unique<Captured<TaskSE3Equality>>(se3()));
      else if (py::extract<TaskComEquality&> com(each); com.check())
        tasks.push_back(std::make_unique<Captured<TaskComEquality>>(com()));
      else
        tasks.push_back(std::make_unique<Captured<TaskJointPosture>>(
            py::extract<TaskJointPosture&>(each)()));
    }
  }

  // Adds a state with the references that the tasks have now.
  void add(double t, py::list q, py::list v) {
    Eigen::VectorXd q_(py::len(q)), v_(py::len(v));
    for (int i = 0; i < q_.size(); ++i) q_[i] = py::extract<double>(q[i]);
    for (int i = 0; i < v_.size(); ++i) v_[i] = py::extract<double>(v[i]);
    times.push_back(t), qs.push_back(q_), vs.push_back(v_);
    for (auto& task : tasks) task->capture();
  }

  // Takes one step; returns its time [ns].
  double step(std::size_t i) {
    auto start = std::chrono::steady_clock::now();
    for (auto& task : tasks) task->set(i);
    const auto& data = problem.computeProblemData(times[i], qs[i], vs[i]);
    tau = problem.getActuatorForces(solver.solve(data));
    return std::chrono::duration<double, std::nano>(
        std::chrono::steady_clock::now() - start).count();
  }

  py::list run(std::size_t begin, std::size_t end) {
    py::list elapsed;
    for (std::size_t i = begin; i < end; ++i) elapsed.append(step(i));
    return elapsed;
  }

  py::list efforts() const {
    py::list values;
    for (double x : tau) values.append(x);
    return values;
  }
};

BOOST_PYTHON_MODULE(tsid_in_cpp_built) {
  py::class_<Steps, boost::noncopyable>(
      "Steps", py::init<py::object, py::object, py::list>())
      .def("add", &Steps::add).def("run", &Steps::run).def("efforts", &Steps::efforts);
}
