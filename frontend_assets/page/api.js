// Requests to the server. Every refusal becomes one error that carries the problem document.

const TIMEOUT_MS = 4000;

/** A refusal: `message` is the problem's detail, `status` 0 when the server was not reached. */
export class Refusal extends Error {
  constructor(problem, status) {
    super(problem.detail || problem.title || `The server answered ${status}.`);
    this.name = "Refusal";
    this.status = status;
    this.code = problem.code ?? "";
    this.problem = problem;
  }
}

let leaseId = null;

/** Remember the lease that later requests act under; null forgets it. */
export function actUnder(id) {
  leaseId = id;
}

/** Send a request; resolves with the parsed answer, rejects with a Refusal. */
export async function call(method, path, body, timeout_ms = TIMEOUT_MS) {
  const headers = { Accept: "application/json" };
  if (body !== undefined) headers["Content-Type"] = "application/json";
  if (leaseId !== null) headers["X-Keyhole-Lease"] = leaseId;
  let answer;
  let text;
  try {
    answer = await fetch(path, {
      method,
      headers,
      body: body === undefined ? undefined : JSON.stringify(body),
      credentials: "same-origin",
      cache: "no-store",
      signal: AbortSignal.timeout(timeout_ms),
    });
    text = await answer.text();
  } catch (cause) {
    const late = cause.name === "TimeoutError";
    const detail = late ? "The server did not answer in time." : "The server cannot be reached.";
    throw new Refusal({ detail, code: "unreachable" }, 0);
  }
  const content = parse(text);
  if (!answer.ok) throw new Refusal(typeof content === "object" && content ? content : {}, answer.status);
  return content;
}

function parse(text) {
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}
