/* Search without a server: pages that are opened as files may start no Web Worker, so the theme's search runs in a
   hidden frame of the page instead. The theme looks for this class by its name. On a server this file does nothing. */
class IFrameWorker extends EventTarget {
  constructor(url) {
    super();
    this.onmessage = null;
    this.frame = document.createElement("iframe");
    this.frame.hidden = true;
    document.body.appendChild(this.frame);
    window.addEventListener("message", (event) => {
      if (event.source !== this.frame.contentWindow) return;
      const message = new MessageEvent("message", { data: event.data });
      this.dispatchEvent(message);
      if (this.onmessage) this.onmessage(message);
    });
    const page = this.frame.contentWindow.document;
    page.open();
    page.write(
      "<!doctype html><body><script>" +
        "window.postMessage = (data) => parent.postMessage(data, '*');" +
        "window.importScripts = (...urls) => urls.reduce((before, url) => before.then(() => new Promise((done, fail) => {" +
        "const script = document.createElement('script'); script.onload = done; script.onerror = fail; script.src = url;" +
        "document.body.appendChild(script); })), Promise.resolve());" +
        "<\/script><script src=\"" + url + "\"><\/script></body>",
    );
    page.close();
  }

  postMessage(data) {
    const send = () =>
      this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data }));
    const page = this.frame.contentWindow.document;
    if (page.readyState === "complete") send();
    else this.frame.addEventListener("load", send, { once: true });
  }

  terminate() {
    this.frame.remove();
  }
}

window.IFrameWorker = IFrameWorker;
if (location.protocol === "file:") window.Worker = IFrameWorker;
