"use strict";
/* The row in view, in both windows: lifelines and table. It remains in view after changes of filters and groups. */
(() => {
  Sniffer.Sight = class {
    constructor(page) {
      this.page = page;
    }

    /* The row in view: of the chosen message, else of the moment, else the top row; and its distance from the top. */
    held() {
      const { filter, view, model, list, chart, time } = this.page;
      const { layout } = view;
      const chosen = view.selected >= 0 && view.selected < model.messageCount;
      const row = layout === "table" ? Math.floor(list.top) : Math.floor(view.top);
      const top = filter.length ? filter.at(Math.min(Math.max(row, 0), filter.length - 1)) : 0;
      const message = chosen ? view.selected : time.touched ? model.rowOf(view.moment) : top;
      const at = filter.rowOf(message);
      const within = (from, rows) => (at >= from && at <= from + rows - 1 ? at - from : message === top ? 0 : Math.max(rows, 1) / 2.5);
      return { message, chosen, chart: within(view.top, chart.shape.rowsInWindow), list: within(list.top, list.inWindow) };
    }

    /* Restores the position of the row in view after a change of the shown rows. */
    hold({ message, chosen, chart: down, list: below }) {
      const { filter, view, model, chart, list, lanes } = this.page;
      const row = filter.rowOf(message);
      view.set({ top: row - down });
      chart.shape.clamp();
      list.top = Math.max(row - below, 0);
      if (chosen) chart.reveal(row, lanes.of[model.messages.sender[message]]);
    }

    /* After one window was scrolled, show the same top row in the other one, as far as possible. */
    scrolled(window) {
      const { view, list, chart } = this.page;
      if (view.layout !== "both" || !list.grid.clientHeight) return;
      if (window === chart) list.top = view.top;
      else {
        view.set({ top: list.top });
        chart.clamp();
      }
    }

    /* Shows the same rows in both windows, after a change of their sizes or visibility. */
    align() {
      const { filter, view, list } = this.page;
      if (!filter.length) return;
      const held = this.held();
      this.hold({ ...held, list: view.layout === "table" ? held.chart : Math.min(held.chart, list.inWindow - 1) });
    }

    /* Scrolls both windows to a newly chosen message, or else moment. */
    reveal(changed) {
      const { view, filter, model, chart, list, time, lanes } = this.page;
      const chosen = changed.has("selected") && view.selected >= 0 && view.selected < model.messageCount;
      if (chosen || (time.moved && view.moment < model.stepCount)) {
        const row = filter.rowOf(chosen ? view.selected : model.rowOf(view.moment));
        chart.reveal(row, lanes.of[chosen ? model.messages.sender[view.selected] : model.steps.robot[view.moment]]);
        list.reveal(row);
      }
      time.moved = false;
    }
  };
})();
