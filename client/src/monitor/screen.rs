//! The monitor on a terminal: four panels, redrawn every second; `q`, Esc or Ctrl-C ends it.

use std::time::Duration;

use anyhow::Context;
use inekf_shared::message::{STATE_RUNNING, STATE_STALE, STATE_WAITING};
use inekf_shared::topic::Instance;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span, Text};
use ratatui::widgets::{Block, Paragraph, Sparkline};
use ratatui::{DefaultTerminal, Frame};

use super::{Picture, monitor, text};

/// Shows the daemon of `instance` until a key ends it, or `stop` says so.
///
/// # Errors
/// No daemon answers, a port fails, or the terminal does.
///
/// It is not run here, for it takes the terminal, and needs a daemon, another process:
///
/// ```no_run
/// use inekf_client::monitor::screen;
/// use inekf_shared::topic::Instance;
///
/// screen::show(&Instance::new("car")?, &|| false)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn show(instance: &Instance, stop: &dyn Fn() -> bool) -> anyhow::Result<()> {
    let mut terminal: DefaultTerminal = ratatui::try_init().context("taking the terminal")?;
    let outcome = monitor(
        instance,
        &mut || Ok(stop() || quit_pressed()?),
        &mut |picture| {
            terminal.draw(|frame| draw(frame, picture))?;
            Ok(true)
        },
    );
    // Whatever went wrong, the terminal is given back first.
    ratatui::restore();
    outcome
}

fn quit_pressed() -> anyhow::Result<bool> {
    while event::poll(Duration::ZERO).context("reading the keyboard")? {
        if let Event::Key(key) = event::read().context("reading the keyboard")?
            && key.kind == KeyEventKind::Press
        {
            let interrupt =
                key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
            if interrupt || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc) {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// Draws a picture on the whole frame.
///
/// ```
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, screen};
/// use ratatui::Terminal;
/// use ratatui::backend::TestBackend;
///
/// let picture = Picture::new("car", Model::Imu)?;
/// let mut terminal = Terminal::new(TestBackend::new(100, 30))?;
/// terminal.draw(|frame| screen::draw(frame, &picture))?;
/// let text: String = terminal.backend().buffer().content().iter().map(|cell| cell.symbol()).collect();
/// assert!(text.starts_with(" car model imu"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn draw(frame: &mut Frame<'_>, picture: &Picture) {
    let [head, upper, lower, timing] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(10),
        Constraint::Min(4),
        Constraint::Length(5),
    ])
    .areas(frame.area());
    let [left, right] =
        Layout::horizontal([Constraint::Length(58), Constraint::Min(20)]).areas(upper);
    draw_head(frame, head, picture);
    draw_lines(frame, left, "Estimate", text::estimate(picture));
    draw_lines(frame, right, "Inputs", text::inputs(picture));
    draw_lines(frame, lower, "Fixes", text::updates(picture));
    draw_latency(frame, timing, picture);
}

fn draw_head(frame: &mut Frame<'_>, area: Rect, picture: &Picture) {
    let colour = match picture.health.map(|health| health.state) {
        Some(STATE_RUNNING) => Color::Green,
        None | Some(STATE_STALE | STATE_WAITING) => Color::Red,
        Some(_) => Color::Yellow,
    };
    let line = Line::from(vec![
        Span::styled(
            format!(" {} ", picture.instance),
            Style::new().add_modifier(Modifier::BOLD),
        ),
        Span::raw(format!("model {}  ", picture.model)),
        Span::styled(text::state(picture), Style::new().fg(colour)),
        Span::raw("   q: quit"),
    ]);
    frame.render_widget(Paragraph::new(line), area);
}

fn draw_lines(frame: &mut Frame<'_>, area: Rect, title: &str, lines: Vec<String>) {
    let text: Text<'_> = lines.into_iter().map(Line::from).collect();
    frame.render_widget(
        Paragraph::new(text).block(Block::bordered().title(title)),
        area,
    );
}

fn draw_latency(frame: &mut Frame<'_>, area: Rect, picture: &Picture) {
    let title = if picture.latency.is_empty() {
        "Latency".to_owned()
    } else {
        format!(
            "Sent to published: {}; p99 by the second below",
            text::latency(picture)
        )
    };
    let shown = usize::from(area.width.saturating_sub(2));
    let history = &picture.latency_history;
    let newest = &history[history.len().saturating_sub(shown)..];
    let sparkline = Sparkline::default()
        .block(Block::bordered().title(title))
        .data(newest.iter().copied());
    frame.render_widget(sparkline, area);
}
